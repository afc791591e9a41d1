"""A far view over cold water: air that varies with height alone, along tens of kilometres."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from nigemizu.cli.bench.rays import settle, stratified_field
from nigemizu.cli.bench.timing import OFTEN, alternate
from nigemizu.progress import SILENT, ProgressMeter

if TYPE_CHECKING:
    from nigemizu.field import Types
    from nigemizu.trace import Surface

__all__ = ["inversion", "measure_far_view", "wall"]

FloatArray = NDArray[np.float64]

DISTANCE: Final = 40_000.0  # m
ACCURACY: Final = 0.1  # pixel
CHORD: Final = 0.01  # pixel, by which a tested chord may lie from the ray
EARTH_RADIUS: Final = 6_371_000.0  # m
EYE: Final = 10.0  # m
PIXEL: Final = 1.5e-5  # rad; 960 of them are 0.8°, the view of a 2500 mm lens
_MOST_STEPS: Final = 20_000
_COMPARED: Final = 256  # rays
_ON_THE_SEA: Final = 0.01  # m; what is lower has not come to the wall
_FINER: Final = 0.01  # of the accuracy, for the rays that they are compared with


def inversion() -> tuple[FloatArray, FloatArray]:
    """Air that is 9 K warmer above 25 m than over the water, made flat.

    Returns
    -------
    z : (N,) ndarray of float64, m
    refractivity : (N,) ndarray of float64, 1
        n' − 1 with n' = n exp(z/R): over a plane, light travels in n' as it does in n over the Earth.
    """
    from nigemizu.air import Atmosphere

    atmosphere = Atmosphere()
    z = np.linspace(0.0, 100.0, 401)
    temperature = 276.0 + 9.0 / (1.0 + np.exp(-(z - 25.0) / 2.5))
    pressure = atmosphere.hydrostatic_pressure(z, temperature)
    refractivity = atmosphere.refractivity(temperature, pressure)
    # (1 + N) exp(z/R) − 1 without losing the digits of N
    flat = np.expm1(z / EARTH_RADIUS)
    return z, refractivity + flat + refractivity * flat


def measure_far_view(
    size: tuple[int, int] = (960, 600),
    distance: float = DISTANCE,
    repeats: int = OFTEN,
    *,
    progress: ProgressMeter = SILENT,
) -> dict[str, Any]:
    """Time of the bent rays of a picture, one per pixel, to a wall far away.

    Parameters
    ----------
    size : (int, int)
        Width and height of the picture in pixels.
    distance : float, m
        To the wall, at which the rays' heights count.
    repeats : int
    progress : ProgressMeter

    Returns
    -------
    dict
        ``seconds`` of building the table of shared paths and following it with a ray per pixel, and
        ``table_seconds`` of the first part; ``pixels``, ``paths`` flown for the table, ``distance`` [m],
        ``accuracy_pixels``, and ``error_pixels``: the largest displacement at the wall, seen from the eye,
        of ``compared`` rays spread over the picture, against rays marched in double precision to a hundredth
        of the accuracy.

    Notes
    -----
    Sea and wall are planes. The table is made in double precision and followed in single, as for a picture.
    Rays that meet the sea, or leave the air by its top, before they come to the wall are not compared.
    """
    import drjit as dr

    from nigemizu import field, trace

    single, double = field.types("llvm"), field.types("llvm", "double")
    profile = inversion()
    medium, exact = stratified_field(*profile, single), stratified_field(*profile, double)
    width, height = size
    rise, turn = (np.arctan((np.arange(n) + 0.5 - 0.5 * n) * PIXEL) for n in (height, width))
    directions = _directions(np.repeat(rise, width), np.tile(turn, height))
    ahead = single.Array3f(np.ascontiguousarray(directions.T))
    eye, angle = np.array([0.0, 0.0, EYE]), ACCURACY * PIXEL
    view = trace.ElevationView(eye, (rise[0] - 2 * PIXEL, rise[-1] + 2 * PIXEL), PIXEL)
    wide, high = 10.0 * distance, float(profile[0][-1])
    boxes = np.array(
        [[[-wide, -wide, 0.0], [wide, wide, 0.0]], [[distance, -wide, 0.0], [distance + 1.0, wide, high]]]
    )
    surface = trace.combine(trace.ground_plane(0.0), wall(single, distance))
    # Opaque: values that the compiler does not know, as in a picture.
    control = {
        "accuracy": dr.opaque(single.Float, angle),
        "chord_tolerance": dr.opaque(single.Float, CHORD * PIXEL),
        "max_steps": dr.opaque(single.UInt32, _MOST_STEPS),
    }

    def lay() -> Any:
        return trace.share_paths(
            exact, view, boxes, accuracy=angle, max_steps=_MOST_STEPS, rays=1.0, types=single
        )

    def picture() -> tuple[Any, Any]:
        paths = lay()
        return paths, settle(paths.follow(medium, ahead, surface=surface, **control))

    seconds = alternate({"table": lay, "picture": picture}, repeats, label="40 km", progress=progress)
    paths, end = picture()
    chosen = np.linspace(0, width * height - 1, _COMPARED).astype(np.int64)
    there = double.Array3f(np.ascontiguousarray(directions[chosen].T))
    start = double.Array3f(*eye.tolist())
    fine: dict[str, Any] = {
        "accuracy": _FINER * angle,
        "chord_tolerance": _FINER * CHORD * PIXEL,
        "max_steps": _MOST_STEPS,
    }
    around = trace.combine(trace.ground_plane(0.0), wall(double, distance))
    best = settle(trace.march(exact, start, there, surface=around, **fine))
    return {
        "seconds": seconds["picture"],
        "table_seconds": seconds["table"],
        "pixels": width * height,
        "paths": paths.report.paths,
        "distance": distance,
        "accuracy_pixels": ACCURACY,
        **_compared(_reached(end, chosen), _reached(best, slice(None)), distance),
    }


def wall(types: Types, distance: float) -> Surface:
    """The upright plane x = `distance` [m] for rays that come towards it."""
    import drjit as dr

    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        there = (types.Float(distance) - origin.x) / dr.maximum(direction.x, 1e-6)
        return active & (there > 0) & (there <= length), there

    return surface


def _directions(elevation: FloatArray, azimuth: FloatArray) -> FloatArray:
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)


def _reached(end: Any, chosen: Any) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Where some of the rays ended, (N, 3) m, and which of them on the wall."""
    position = np.asarray(end.position, dtype=np.float64).T[chosen]
    return position, np.asarray(end.hit)[chosen] & (position[:, 2] > _ON_THE_SEA)


def _compared(
    mine: tuple[FloatArray, NDArray[np.bool_]], best: tuple[FloatArray, NDArray[np.bool_]], distance: float
) -> dict[str, Any]:
    """Largest displacement on the wall, of rays that come there by both ways."""
    both = mine[1] & best[1]
    apart = np.linalg.norm((mine[0] - best[0])[both, 1:], axis=1) / distance / PIXEL
    return {"compared": int(both.sum()), "error_pixels": float(apart.max()) if both.any() else None}
