"""The transfer curve: which height of a distant object is seen under which elevation."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NoReturn, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.progress import SILENT, ProgressMeter
from nigemizu.scene.measuring.curve import TransferCurve
from nigemizu.scene.measuring.folds import find_images, image_count
from nigemizu.scene.measuring.transfer_rays import Flight, flight_of
from nigemizu.scene.running import AirSource, Variant, air_at

if TYPE_CHECKING:
    from nigemizu.scene.model import Scene

__all__ = ["curve_through", "transfer_curve"]

FloatArray: TypeAlias = NDArray[np.float64]

_FAN: Final = 2001  # rays over the elevations, besides those that were asked for
_AROUND: Final = 1.0  # degrees above and below the horizon and the foot of the target
_BESIDE: Final = 1e-6  # rad, to the two rays that give the slope
_ERROR: Final = 2e-12  # of the distance, that heights may err by, where nothing is said …
_LEAST_ERROR: Final = 1e-8  # m … but this is always allowed
_NOISE: Final = 4.0  # errors by which heights must differ to count as different
_STEEPEST: Final = 89.0  # degrees
_BESIDE_ONE: Final = 0.01  # degrees, over which folds are sought where one elevation was asked for
_FARTHEST: Final = 2.5e6  # m


def transfer_curve(
    scene: Scene,
    distance: float,
    elevations: Iterable[float] | None = None,
    azimuth: float = 0.0,
    *,
    time: float | None = None,
    air: AirSource = None,
    tolerance: float | None = None,
    variant: Variant = "auto",
    progress: ProgressMeter = SILENT,
) -> TransferCurve:
    """Which height at a distance is seen under which elevation, from the camera's eye.

    Parameters
    ----------
    scene : Scene
        With air in layers, heated on a mesh, or both; over a flat Earth or a round one.
    distance : float, m
        Of the object from the eye, along the surface of the Earth; up to 2500 km.
    elevations : iterable of float, degrees, optional
        Above the horizontal; 2001 over what the camera sees within 1° of horizon and target unless given.
        Folds are sought between the least and the greatest by as many rays, however few are asked for.
    azimuth : float, degrees
        From the camera's heading, positive to the left.
    time, air, variant, progress
        As of `nigemizu.scene.Scene.render`.
    tolerance : float, m, optional
        Error of the heights that the integration may add; 2e-12 of the distance, at least 1e-8 m.

    Returns
    -------
    TransferCurve

    Raises
    ------
    InputError
        The distance or an elevation is out of range, or no ray comes to the distance.

    Notes
    -----
    The rays of `nigemizu.trace.march` in double precision end on the upright plane across the line of sight;
    of objects in the scene only grounds stop them. Folds are h(e) with dh/de = 0: there two images meet, and
    a height between two folds has three images, an odd number as in all open air.

    References
    ----------
    W. H. Lehn (1983), Inversion of superior mirage data to compute temperature profiles, J. Opt. Soc. Am. 73,
    1622–1625, doi:10.1364/JOSA.73.001622 (transfer characteristic); W. Tape (1985), The topology of mirages,
    Scientific American 252(6), 120–129.

    Examples
    --------
    A ship 16 km away under a warm layer of air is seen three times between 14.8 and 18.7 m:

    >>> from nigemizu.scene import Scene
    >>> curve = transfer_curve(Scene.load("fata-morgana"), 16093.0)
    >>> [(round(fold.height, 1), fold.kind) for fold in curve.folds]
    [(18.7, 'highest'), (14.8, 'lowest')]
    >>> curve.count([10.0, 16.0, 40.0]).tolist()
    [1, 3, 1]
    """
    if not (math.isfinite(distance) and 0.0 < distance <= _FARTHEST):
        raise InputError(
            "no distance of an object",
            key="distance",
            value=distance,
            expected="metres from above 0 to 2.5e6",
        )
    scene.check()
    error = max(_ERROR * distance, _LEAST_ERROR) if tolerance is None else tolerance
    if not (math.isfinite(error) and error > 0.0):
        raise InputError("no error of heights", key="tolerance", value=tolerance, expected="metres above 0")
    asked, span = _elevations(scene, distance, elevations)
    volume = air_at(scene, time, air, progress, variant)
    flight = flight_of(scene, volume, distance, azimuth, error, variant)
    radius = scene.earth.radius if scene.earth is not None and scene.round else math.inf
    curve = curve_through(
        flight, asked, distance, span=span, eye=scene.camera.eye[2], radius=radius, tolerance=error
    )
    if not curve.bands:
        _refuse(curve, scene)
    return replace(curve, scene=scene, air=volume)


def curve_through(
    flight: Flight,
    elevation: ArrayLike,
    distance: float,
    *,
    span: tuple[float, float] | None = None,
    eye: float = 0.0,
    radius: float = math.inf,
    tolerance: float = 1e-8,
) -> TransferCurve:
    """The curve that rays make.

    Parameters
    ----------
    flight : callable
        `nigemizu.scene.measuring.transfer_rays.Flight`: where rays of elevations [rad] go.
    elevation : (N,) array_like, degrees
    distance : float, m
    span : (float, float), degrees, optional
        Where folds are sought; from the least of the elevations to the greatest unless given.
    eye : float, m
        Its height.
    radius : float, m
        Of the Earth.
    tolerance : float, m
        Error of the heights.
    """
    asked = np.asarray(elevation, dtype=np.float64).ravel()
    low, high = span or (float(asked.min()), float(asked.max()))
    fan = np.unique(np.concatenate([np.linspace(low, high, _FAN), asked]))
    rising = np.radians(fan)
    # The slopes cannot come from the fan: near its folds it is too coarse.
    beside = np.concatenate([np.radians(asked) - _BESIDE, np.radians(asked) + _BESIDE])
    found = flight(np.concatenate([rising, beside]))
    height, before, after = np.split(found.height, [len(fan), len(fan) + len(asked)])
    folds, bands = find_images(lambda more: flight(more).height, rising, height, tolerance=_NOISE * tolerance)
    own = np.searchsorted(fan, asked)
    straight = _straight_height(rising, distance, eye, radius)
    slope = (after - before) / (2 * _BESIDE)
    with np.errstate(divide="ignore"):
        magnification = _straight_slope(np.radians(asked), distance, eye, radius) / slope
    return TransferCurve(
        distance=distance,
        elevation=asked,
        height=height[own],
        ground_distance=found.ground_distance[: len(fan)][own],
        slope=slope,
        magnification=magnification,
        images=image_count(bands, height[own]),
        straight=straight[own],
        folds=folds,
        bands=bands,
        fan=np.stack([rising, height, straight]),
    )


def _straight_height(elevation: FloatArray, distance: float, eye: float, radius: float) -> FloatArray:
    """h without air [m]: (R + eye) cos e / cos(e + φ) − R with φ = distance/R, or eye + distance tan e."""
    if math.isinf(radius):
        return np.asarray(eye + distance * np.tan(elevation))
    angle = distance / radius
    # cos e / cos(e + φ) − 1 without losing its digits
    growth = 2 * np.sin(elevation + angle / 2) * math.sin(angle / 2) / np.cos(elevation + angle)
    return np.asarray(eye + (radius + eye) * np.where(elevation + angle < math.pi / 2, growth, np.nan))


def _straight_slope(elevation: FloatArray, distance: float, eye: float, radius: float) -> FloatArray:
    """dh/de without air [m/rad]: of h = (R + eye) cos e / cos(e + φ) − R, φ = distance/R, or of a plane."""
    if math.isinf(radius):
        return np.asarray(distance / np.cos(elevation) ** 2)
    angle = distance / radius
    return np.asarray((radius + eye) * math.sin(angle) / np.cos(elevation + angle) ** 2)


def _elevations(
    scene: Scene, distance: float, asked: Iterable[float] | None
) -> tuple[FloatArray, tuple[float, float]]:
    """Elevations of the rays, and the span over which folds are sought [degrees]."""
    if asked is not None:
        values = np.array(list(asked), dtype=np.float64)
        if not values.size or not np.all(np.abs(values) <= _STEEPEST):
            wrong = None if not values.size else float(values[np.argmax(~(np.abs(values) <= _STEEPEST))])
            raise InputError(
                "no elevation of a ray to a distant object",
                key="elevation",
                value=wrong,
                expected=f"degrees from -{_STEEPEST:g} to {_STEEPEST:g}",
            )
        low, high = float(values.min()), float(values.max())
        return values, (low, high) if low < high else (low - _BESIDE_ONE, high + _BESIDE_ONE)
    camera = scene.camera
    middle = math.degrees(math.asin(camera.direction[2]))
    half = math.degrees(math.atan(camera.height / 2 * camera.pixel_angle))
    drop = 0.0 if scene.earth is None or not scene.round else distance / (2 * scene.earth.radius)
    foot = -math.degrees(math.atan(camera.eye[2] / distance + drop))
    low, high = max(middle - half, foot - _AROUND), min(middle + half, _AROUND)
    if low >= high:  # the camera looks elsewhere
        low, high = max(middle - half, -_STEEPEST), min(middle + half, _STEEPEST)
    return np.linspace(low, high, _FAN), (low, high)


def _refuse(curve: TransferCurve, scene: Scene) -> NoReturn:
    """No ray came to the target: say why."""
    met = curve.ground_distance[np.isfinite(curve.ground_distance)]
    far = f"{curve.distance / 1e3:g} km"
    if met.size:
        raise InputError(
            f"all rays meet the ground before {far}, the last at {met.max() / 1e3:.4g} km",
            key="distance",
            value=curve.distance,
            remedy="take higher elevations (--elevation), a shorter distance, or a higher camera.eye",
        )
    raise InputError(
        f"all rays leave the air before {far}",
        key="elevation",
        value=float(curve.elevation.min()),
        remedy="take lower elevations (--elevation), or a profile that reaches higher",
    )
