"""Ground truth: what each pixel sees, and where that would be seen without air."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, final

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from nigemizu import field, trace
from nigemizu.errors import InputError
from nigemizu.render.bending import Bending
from nigemizu.render.globe import Globe
from nigemizu.render.pinhole import Pinhole
from nigemizu.render.sharing import FilmView
from nigemizu.render.variant import current_backend

__all__ = ["GroundTruth", "ground_truth"]

_FINER: Final = 0.2  # of the picture's accuracy
_CHORDS: Final = 0.05  # of it, that chords may use up
_FIXED: Final = 0.1  # pixels: accuracy where the picture's rays have a fixed step
_RAYS: Final = 1 << 19  # at a time


@final
@dataclass(frozen=True)
class GroundTruth:
    """What the rays through the middles of the pixels see; each (height, width) float64, row 0 at the top.

    Attributes
    ----------
    displacement_x, displacement_y : pixels
        From where what is seen would be without air to where it appears; to the right, and down. NaN where
        it would be behind the eye, or the ray was lost.
    path_length : m
        Along the bent ray to what it meets; infinite where it meets nothing.
    straight_distance : m
        To what the pixel shows without air; infinite where that is nothing.
    turning_height : m
        Least height at which the ray turns upwards; NaN where it does not.
    optical_path_excess : m
        ∫ n ds − ∫ ds as far as the air bends light, or to what is met.
    status : int
        `nigemizu.trace.RayStatus`.
    """

    displacement_x: NDArray[np.float64]
    displacement_y: NDArray[np.float64]
    path_length: NDArray[np.float64]
    straight_distance: NDArray[np.float64]
    turning_height: NDArray[np.float64]
    optical_path_excess: NDArray[np.float64]
    status: NDArray[np.int64]


def ground_truth(
    bending: Bending, scene: Any, sensor: Any, *, globe: Globe | None = None, vacuum: Any = None
) -> GroundTruth:
    """Follow the ray through the middle of each pixel, in double precision.

    Parameters
    ----------
    bending : Bending
        With the air of the instant, prepared for the sensor.
    scene : mi.Scene
    sensor : mi.Sensor
        A pinhole camera.
    globe : Globe, optional
        Of a round Earth.
    vacuum : Field, optional
        The map of a round Earth without air, in double precision.

    Returns
    -------
    GroundTruth

    Raises
    ------
    InputError
        If rays of the sensor do not meet in one point.

    Notes
    -----
    What a ray meets at the point p is seen without air in the direction p − eye; what lies infinitely far, in
    the ray's final direction. Rays are marched one by one, to a fifth of the picture's accuracy. Over a round
    Earth lengths and heights are those of its map (`nigemizu.air.Earth`), one part in 10⁵ less at 60 m.

    Limits: the middle of each pixel stands for all of it. Panes are marched as panes, straight rays have no
    displacement.
    """
    pinhole = Pinhole.of(sensor)
    if pinhole is None:
        raise InputError("ground truth needs a camera whose rays meet in one point", key="camera")
    width, height = pinhole.size
    view = FilmView(pinhole, bending.frame)
    y, x = (axis.ravel() + 0.5 for axis in np.mgrid[0:height, 0:width])
    air = bending.reference() if bending.method != "straight" else None
    if air is not None and bending.method == "bent":
        air = trace.grounded(air, bending.boxes(scene))
    world = (globe, vacuum)
    parts = [
        _rows(bending, scene, view, air, world, x[first : first + _RAYS], y[first : first + _RAYS])
        for first in range(0, x.size, _RAYS)
    ]
    columns = (np.concatenate(column).reshape(height, width) for column in zip(*parts, strict=True))
    return GroundTruth(*columns)


def _rows(
    bending: Bending,
    scene: Any,
    view: FilmView,
    air: Any,
    world: tuple[Globe | None, Any],
    x: Any,
    y: Any,
) -> tuple[NDArray[Any], ...]:
    globe, vacuum = world
    types = field.types(current_backend(), "double", differentiable=True) if air is None else air.types
    surface = bending.frame.surface(scene)
    eye, ahead = view.rays(types, x, y)
    if vacuum is None:
        straight = trace.straight(types, eye, ahead, surface=surface, details=True)
    else:
        straight = _march(bending, vacuum, eye, ahead, surface)
    end = straight if air is None else _march(bending, air, eye, ahead, surface)
    if globe is None:
        seen = dr.select(end.hit, dr.normalize(end.position - eye), end.direction)
    else:
        outward = globe.outward(end.position, end.direction)
        seen = dr.select(end.hit, globe.towards(end.position), outward)
    there = view.locate(seen)
    lost = end.status == int(trace.RayStatus.OUT_OF_STEPS)
    shift = [
        dr.select(lost, dr.nan, types.Float(apparent) - true)
        for apparent, true in zip((x, y), there, strict=True)
    ]
    columns = (
        *shift,
        dr.select(end.hit, end.path_length, dr.inf),
        dr.select(straight.hit, straight.path_length, dr.inf),
        end.turning_height,
        end.optical_path - end.path_length,
    )
    dr.eval(columns, end.status)
    numbers = tuple(np.broadcast_to(np.asarray(part, dtype=np.float64), x.shape) for part in columns)
    return *numbers, np.broadcast_to(np.asarray(end.status, dtype=np.int64), x.shape)


def _march(bending: Bending, air: Any, eye: Any, ahead: Any, surface: Any) -> trace.RayEnd:
    types = air.types
    steps = dr.opaque(types.UInt32, bending.tracer.max_steps)
    if bending.method == "layered":
        return trace.cross_layers(air, eye, ahead, max_crossings=steps, surface=surface, details=True)
    accuracy = bending.angle if bending.controlled else _FIXED * bending.pixel_angle
    return trace.march(
        air,
        eye,
        ahead,
        accuracy=dr.opaque(types.Float, accuracy * _FINER),
        chord_tolerance=dr.opaque(types.Float, accuracy * _CHORDS),
        max_steps=steps,
        surface=surface,
        details=True,
    )
