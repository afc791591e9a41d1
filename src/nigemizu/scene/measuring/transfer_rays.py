"""Rays from the eye to the upright plane in which a far object stands."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.scene.far_air import FarAir, medium
from nigemizu.scene.mapped import mapped_camera, mapped_objects

if TYPE_CHECKING:
    from nigemizu.scene.model import Scene
    from nigemizu.scene.running import AirVolume, Variant

__all__ = ["Arrivals", "Flight", "flight_of", "flight_through"]

FloatArray: TypeAlias = NDArray[np.float64]

_STEPS: Final = 200_000
_LEVEL: Final = 1e-9  # cosine of the elevation below which a ray never comes to the plane
_AT_GROUND: Final = 1e-9  # of the way, that a hit on the ground may lie before the plane
_CHORDS: Final = 30.0  # tolerances, that a chord may lie from its ray
_SHARE: Final = 0.1  # of the tolerance, for steps: they know of their own errors only


class Arrivals(NamedTuple):
    """Where rays went.

    Attributes
    ----------
    height : (N,) float64, m
        At which each crosses the plane; NaN if it meets the ground before, or leaves the air.
    ground_distance : (N,) float64, m
        At which it meets the ground, along it; NaN if it does not.
    """

    height: FloatArray
    ground_distance: FloatArray


Flight: TypeAlias = Callable[[FloatArray], Arrivals]
"""Where rays of elevations [rad] go."""


def flight_of(
    scene: Scene, air: AirVolume, distance: float, azimuth: float, tolerance: float, variant: Variant
) -> Flight:
    """Rays through a scene's air, with heights above the sea.

    Parameters
    ----------
    scene : Scene
    air : AirVolume
    distance : float, m
        Of the plane, along the ground.
    azimuth : float, degrees
        From the camera's heading, to the left.
    tolerance : float, m
        Error of the heights.
    variant : {"auto", "llvm", "cuda"}

    Raises
    ------
    InputError
        If the eye is not above the ground.
    """
    from nigemizu.render import Ground, select_variant

    select_variant(variant)
    tracer = scene.tracer
    if tracer.method == "straight" and scene.round:
        air = FarAir.of(scene).vacuum()
    through = medium(scene, air, precision="double")
    eye = mapped_camera(scene).eye
    grounds = [entry.height for entry in mapped_objects(scene) if isinstance(entry, Ground)]
    ground = max(grounds, default=0.0)
    if eye[2] <= ground:
        raise InputError(
            "the eye is not above the ground",
            key="camera.eye",
            value=scene.camera.eye,
            expected=f"z above {ground:g} m",
        )
    ahead = scene.camera.direction
    heading = math.atan2(ahead[1], ahead[0]) + math.radians(azimuth)
    straight = "line" if tracer.method == "straight" and not scene.round else ""
    mapped = flight_through(
        through,
        eye,
        heading=heading,
        distance=distance,
        ground=ground,
        tolerance=tolerance,
        method=straight or ("panes" if tracer.method == "layered" else "bent"),
        top=float(air.z[-1]) if scene.round else math.inf,
    )
    if scene.earth is None:
        return mapped
    earth = scene.earth

    def flight(elevation: FloatArray) -> Arrivals:
        height, ground_distance = mapped(elevation)
        return Arrivals(earth.height(height), ground_distance)

    return flight


def flight_through(
    through: Any,
    eye: tuple[float, float, float],
    *,
    distance: float,
    heading: float = 0.0,
    ground: float = 0.0,
    tolerance: float = 1e-7,
    method: str = "bent",
    top: float = math.inf,
) -> Flight:
    """Rays through a field over a plane.

    Parameters
    ----------
    through : nigemizu.field.Field or nigemizu.field.Layers
        In double precision.
    eye : (3,) float, m
    distance : float, m
    heading : float, rad
        From x towards y.
    ground : float, m
        Height of the plane that rays end on.
    tolerance : float, m
    method : {"bent", "panes", "line"}
        Whether light is bent, refracted at panes, or straight.
    top : float, m
        Height at which rays leave what is known of the air.

    Notes
    -----
    The steps may use up the tolerance, as an angle at the eye. The chords on which the plane and the ground
    are looked for may lie 30 times as far from the ray; where it crosses the plane is found on the ray
    itself, by following it once more, for as long as the chords say.
    """
    import drjit as dr

    from nigemizu import trace

    types = through.types
    level = (math.cos(heading), math.sin(heading))
    surface = trace.combine(_upright(types, eye, level, distance), trace.ground_plane(ground))
    angle = tolerance / distance

    def flight(elevation: FloatArray) -> Arrivals:
        cosine = np.cos(elevation)
        ways = (cosine * level[0], cosine * level[1], np.sin(elevation))
        ahead = types.Array3f(*(types.Float(np.ascontiguousarray(way)) for way in ways))
        origin = types.Array3f(*(types.Float(np.full(elevation.shape, place)) for place in eye))
        if method == "bent":
            steps: dict[str, Any] = {"accuracy": _SHARE * angle, "max_steps": _STEPS}
            end = trace.march(
                through, origin, ahead, surface=surface, chord_tolerance=_CHORDS * angle, **steps
            )
            # The same once more without chords, just as far: onto the ray itself.
            arrived = end.hit & (_along(end.position, eye, level) >= distance * (1 - _AT_GROUND))
            there = trace.march(through, origin, ahead, max_distance=end.path_length, active=arrived, **steps)
            end.position = dr.select(arrived, _onto(there, eye, level, distance), end.position)
        elif method == "panes":
            end = trace.cross_layers(through, origin, ahead, max_crossings=_STEPS, surface=surface)
        else:
            end = trace.straight(types, origin, ahead, surface=surface)
        return _arrivals(end, eye, level, distance, top, elevation.shape)

    return flight


def _arrivals(
    end: Any,
    eye: tuple[float, float, float],
    level: tuple[float, float],
    distance: float,
    top: float,
    shape: tuple[int, ...],
) -> Arrivals:
    from nigemizu import trace

    position = np.asarray(end.position, dtype=np.float64)
    position = np.broadcast_to(position.reshape(3, -1), (3, *shape))
    status = np.broadcast_to(np.asarray(end.status), shape)
    if np.any(status == trace.OUT_OF_STEPS):
        raise InputError(
            f"rays use up {_STEPS} steps before they come to the target",
            key="distance",
            value=distance,
            remedy="take it nearer, or smoother air",
        )
    along = _along(position, eye, level)
    hit = status == trace.HIT
    arrived = hit & (along >= distance * (1 - _AT_GROUND))
    height = np.where(arrived & (position[2] <= top), position[2], np.nan)
    return Arrivals(height, np.where(hit & ~arrived, along, np.nan))


def _along(position: Any, eye: tuple[float, float, float], level: tuple[float, float]) -> Any:
    """How far [m] positions lie before the eye, along the line of sight."""
    return (position[0] - eye[0]) * level[0] + (position[1] - eye[1]) * level[1]


def _onto(end: Any, eye: tuple[float, float, float], level: tuple[float, float], distance: float) -> Any:
    """Ends near the plane taken onto it, along their directions."""
    import drjit as dr

    speed = end.direction[0] * level[0] + end.direction[1] * level[1]
    short = distance - _along(end.position, eye, level)
    return dr.fma(end.direction, short / dr.maximum(speed, _LEVEL), end.position)


def _upright(types: Any, eye: tuple[float, float, float], level: tuple[float, float], distance: float) -> Any:
    """The upright plane across the line of sight, as a surface."""
    import drjit as dr

    def surface(origin: Any, direction: Any, length: Any, active: Any) -> tuple[Any, Any]:
        speed = direction.x * level[0] + direction.y * level[1]
        there = (types.Float(distance) - _along(origin, eye, level)) / dr.maximum(speed, _LEVEL)
        return active & (speed > _LEVEL) & (there > 0) & (there <= length), there

    return surface
