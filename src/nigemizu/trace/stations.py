"""Flying rays from station to station: their state at given path lengths, in one launch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from nigemizu.field import Field
from nigemizu.trace.controlled import FIRST_TRIAL, ControlledSteps
from nigemizu.trace.march import run
from nigemizu.trace.stepping import Flight
from nigemizu.trace.view import View

__all__ = ["Flown", "Stations", "fly", "fly_places"]


FloatArray = NDArray[np.float64]
Array = NDArray[np.floating[Any]]


@final
@dataclass(frozen=True)
class Stations:
    """Where rays are looked at, and where what is seen is written; one entry per ray but for `lengths`.

    Attributes
    ----------
    lengths : Float, m
        Path lengths, increasing for each ray.
    first, step : UInt32
        The k-th of the ray stands at index ``first + k * step``.
    count : UInt32
        How many it has.
    target, stride : UInt32
        The k-th state of the ray is written at index ``target + k * stride``.
    """

    lengths: Any
    first: Any
    step: Any
    count: Any
    target: Any
    stride: Any


@final
@dataclass
class _Records:
    """States at the stations, flat arrays of the field's Float (UInt32 for `lost`)."""

    position: Any  #   3 × Float  m
    direction: Any  #  3 × Float  1
    stray: Any  #      Float      m   bound of how far the path strays from the chord since the station before
    outside: Any  #    UInt32         1 where the ray has left the volume, or never met it
    lost: Any  #       UInt32         1 where it has used up its steps
    steps: Any  #      UInt32         steps made so far
    lowest: Any  #     Float      m   least height at the end of a step so far; infinite before the first


def fly(
    field: Field,
    origin: Any,
    direction: Any,
    *,
    accuracy: Any,
    max_steps: Any,
    stations: Stations,
    size: int,
    ways_only: bool = False,
) -> _Records:
    """Fly rays through the field and write down their state at each station.

    Parameters
    ----------
    field : Field
    origin, direction : Array3f, m and 1
        As in `march`.
    accuracy : Float, rad
    max_steps : UInt32
    stations : Stations
    size : int
        Number of states that are written, by all rays together.
    ways_only : bool
        Leave out directions and steps.

    Notes
    -----
    Surfaces are not looked for. Before and after the volume the rays are straight.
    """
    types = field.types
    entry = field.entry(origin, direction)
    enters = entry < dr.inf
    start = dr.select(enters, entry, 0)
    flight = Flight.begin(field, dr.fma(direction, start, origin), direction, start, enters, FIRST_TRIAL)
    Float, UInt32 = types.Float, types.UInt32
    rest = 0 if ways_only else size
    records = _Records(
        position=[dr.opaque(Float, 0, shape=size) for _ in range(3)],
        direction=[dr.opaque(Float, 0, shape=rest) for _ in range(3)],
        stray=dr.opaque(Float, 0, shape=size),
        outside=dr.opaque(UInt32, 0, shape=size),
        lost=dr.opaque(UInt32, 0, shape=size),
        steps=dr.opaque(UInt32, 0, shape=rest),
        lowest=dr.opaque(Float, 0, shape=size),
    )
    _fly(field, accuracy, UInt32(max_steps), flight, stations, records)
    return records


@dr.syntax
def _fly(
    field: Field, accuracy: Any, max_steps: Any, flight: Flight, stations: Stations, records: _Records
) -> None:
    k = type(stations.first)(0)
    count = type(stations.first)(stations.count)
    while dr.hint(k < count, label="fly to stations", exclude=[records, stations]):
        limit = dr.gather(type(flight.path), stations.lengths, stations.first + k * stations.step, k < count)
        flight = _reach(field, accuracy, max_steps, flight, limit, k < count)
        _write(records, stations.target + k * stations.stride, flight, limit, max_steps)
        k += 1


def _reach(field: Field, accuracy: Any, max_steps: Any, flight: Flight, limit: Any, active: Any) -> Flight:
    """Bend the ray as far as the limit, or to the face of the volume."""
    rule = ControlledSteps(
        field,
        accuracy=accuracy,
        max_steps=max_steps,
        limit=limit,
        chord_tolerance=None,
        max_chord_steps=1,
        details=False,
    )
    flight = flight.at_new_chord()
    return run(rule, flight, active & rule.flying(flight))


def _write(records: _Records, index: Any, flight: Flight, limit: Any, max_steps: Any) -> None:
    ahead = dr.normalize(flight.momentum)
    # Outside the ray is straight: before it (the flight waits at the entry) as well as behind.
    straight = ~flight.inside | (flight.path > limit)
    position = dr.fma(ahead, dr.select(straight, limit - flight.path, 0), flight.position)
    for axis in range(3):
        dr.scatter(records.position[axis], position[axis], index)
    dr.scatter(records.stray, flight.chord_length * flight.chord_turn * 0.25, index)
    one = type(index)(1)
    dr.scatter(records.outside, dr.select(flight.inside, 0, one), index)
    lost = flight.inside & (flight.steps >= max_steps)
    dr.scatter(records.lost, dr.select(lost, one, 0), index)
    dr.scatter(records.lowest, flight.turning, index)
    if not len(records.steps):
        return
    for axis in range(3):
        dr.scatter(records.direction[axis], ahead[axis], index)
    dr.scatter(records.steps, flight.steps, index)


@final
@dataclass(frozen=True)
class Flown:
    """States (6, stops, rays) as offsets from the straight rays [m] and deflections [1], in the view's frame;
    which rays had left the volume at their last stop, which were lost, the steps of all together, and the
    least height of each [m]."""

    states: Array
    outside: NDArray[np.bool_]
    lost: NDArray[np.bool_]
    steps: float
    lowest: Array


def fly_places(
    field: Field,
    view: View,
    x: FloatArray,
    y: FloatArray,
    lengths: FloatArray,
    accuracy: float,
    max_steps: int,
) -> Flown:
    """Fly the rays of places x, y (rays,) [pixels] to their path lengths (stops, rays) [m]."""
    types = field.types
    Float, UInt32 = types.Float, types.UInt32
    stops, rays = lengths.shape
    eye, direction = view.rays(types, x, y)
    lane, stride = dr.arange(UInt32, rays), dr.opaque(UInt32, rays)
    lengths = Float(np.ascontiguousarray(lengths).ravel())
    records = fly(
        field,
        eye,
        direction,
        accuracy=dr.opaque(Float, accuracy),
        max_steps=dr.opaque(UInt32, max_steps),
        stations=Stations(lengths, lane, stride, dr.opaque(UInt32, stops), lane, stride),
        size=rays * stops,
    )
    dr.eval(records.position, records.direction)
    d = dr.gather(types.Array3f, direction, dr.arange(UInt32, rays * stops) % stride)
    offset = view.to_frame(d, types.Array3f(*records.position) - eye - d * lengths)
    deflection = view.to_frame(d, types.Array3f(*records.direction) - d)
    dr.eval(offset, deflection)
    states = np.stack([np.asarray(part) for part in (*offset, *deflection)]).reshape(6, stops, rays)
    lost = np.asarray(records.lost).reshape(stops, rays)[-1] > 0
    steps = float(np.asarray(records.steps).reshape(stops, rays)[-1].sum(dtype=np.float64))
    outside = np.asarray(records.outside).reshape(stops, rays)[-1] > 0
    return Flown(states, outside, lost, steps, np.asarray(records.lowest).reshape(stops, rays)[-1])
