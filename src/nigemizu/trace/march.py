"""The bent ray: marching through a refractive-index field until it meets a surface or leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, final

import drjit as dr

from nigemizu.field import Field
from nigemizu.trace.chords import Chord
from nigemizu.trace.ends import RayEnd, choose_status
from nigemizu.trace.steppers import LEAPFROG, Stepper
from nigemizu.trace.surfaces import Surface

__all__ = ["march"]

_ROUNDING: Final = {"single": 4 * 2.0**-23, "double": 4 * 2.0**-52}
NEAREST: Final = 1.0  # m; nearer to the eye than this the chord tolerance grows no finer


@final
@dataclass
class _Flight:
    """What the marching loop carries from step to step, one entry per ray."""

    position: Any  #     Array3f  m    x
    momentum: Any  #     Array3f  1    p, |p| = n
    path: Any  #         Float    m    ∫ ds so far
    optical: Any  #      Float    m    ∫ n ds so far
    turning: Any  #      Float    m    least height of an upward turn; infinite before the first
    steps: Any  #        UInt32   1    steps made
    inside: Any  #       Bool          still in the volume
    chord_steps: Any  #  UInt32   1    steps since the chord began
    chord_turn: Any  #   Float    rad  bound of the angle turned since the chord began
    last_turn: Any  #    Float    rad  the same of the last step alone

    def at_new_chord(self) -> _Flight:
        """The same ray, about to begin a chord."""
        return replace(self, chord_steps=self.chord_steps * 0, chord_turn=self.chord_turn * 0)


def march(
    field: Field,
    origin: Any,
    direction: Any,
    *,
    step: Any,
    max_steps: Any,
    stepper: Stepper = LEAPFROG,
    surface: Surface | None = None,
    chord_tolerance: Any = None,
    max_chord_steps: int = 32,
    max_distance: Any = None,
    details: bool = False,
    active: Any = True,
) -> RayEnd:
    """March rays through a field.

    Parameters
    ----------
    field : Field
    origin : Array3f, m
    direction : Array3f, 1 — unit length
    step : float or Float, m
        Interval along the ray between turns. It is exact where the index is that at the ray's first
        point in the volume, and n/n₀ times as long elsewhere.
    max_steps : int or UInt32
        Most intervals that a ray may use.
    stepper : Stepper
    surface : callable, optional
        ``surface(origin, direction, length, active) -> (hit, distance)``.
    chord_tolerance : float or Float, optional, rad
        How far a tested chord may lie from the bent ray, as an angle seen from the ray's origin (a
        fraction of a pixel). None tests after every step.
    max_chord_steps : int
        Most steps that share a chord.
    max_distance : Float, optional, m
        Path length at which a ray stops; the last step is shortened to it.
    details : bool
        Also sum the optical path and look for turning points.
    active : Bool
        Rays that take part.

    Returns
    -------
    RayEnd

    Notes
    -----
    The rule of travel: (1) a ray that starts outside the volume goes straight to it, (2) is bent inside,
    (3) and goes straight on for ever after it has left. Surfaces are tested on all three, so a ray is
    HIT whether it meets a surface before, inside or beyond the volume; it has ESCAPED only if it meets
    nothing at all. A ray that turns and comes back up goes on like any other.

    A chord of path length L along which the ray turns by the angles θᵢ strays from it by no more than
    L Σ|θᵢ|/4 (the height of a triangle with these base angles). Steps share a chord while that bound,
    with the next step taken to be like the last, stays under `chord_tolerance` times the distance
    travelled (at least 1 m).

    The call may be nested in a symbolic loop. The step in which a ray leaves the volume is bent wholly
    or not at all: a first-order error, but only of that one step.

    Limits: light is geometric; steps must be short against the length over which the gradient changes.

    References
    ----------
    A. Sharma, D. V. Kumar, A. K. Ghatak (1982), Tracing rays through graded-index media: a new method,
    Applied Optics 21, 984–987, doi:10.1364/AO.21.000984, for the equations in σ.

    Examples
    --------
    A ray that falls by 2 mrad from eye height towards a hot ground turns before it gets there:

    >>> from nigemizu import field, trace
    >>> types = field.types("llvm", "double")
    >>> air = field.ExponentialSquare(types, a=1.00027**2, amplitude=5e-5, height=0.05)
    >>> eye, ahead = types.Array3f(0, 0, 1.5), types.Array3f(1, 0, -0.002)
    >>> end = trace.march(air, eye, ahead, step=0.1, max_steps=10_000, details=True)
    >>> round(float(end.turning_height[0]), 3)
    0.126
    """
    types = field.types
    Float, Array3f, UInt32, Bool = types.Float, types.Array3f, types.UInt32, types.Bool
    origin, d, active = Array3f(origin), Array3f(direction), Bool(active)
    limit = Float(dr.inf if max_distance is None else max_distance)

    # ---- straight to the volume
    entry = field.entry(origin, d)
    chord = Chord.along(origin, d, dr.minimum(entry, limit), Float(0))
    if surface is not None:
        chord = chord.test(surface, active & (entry > 0))
    enters = active & ~chord.found & (entry < limit)
    start = dr.select(enters, entry, 0)

    # ---- bent inside
    x = Array3f(dr.fma(d, start, origin))
    n, _ = field.value_and_gradient(x, active)
    flight = _Flight(
        position=x,
        momentum=Array3f(d * n),
        path=Float(start),
        optical=Float(start * n),
        turning=Float(dr.inf),
        steps=UInt32(0),
        inside=Bool(enters),
        chord_steps=UInt32(0),
        chord_turn=Float(0),
        last_turn=Float(0),
    )
    march_step = _MarchStep(
        field=field,
        stepper=stepper,
        sigma=Float(step) / n,
        step=Float(step),
        max_steps=UInt32(max_steps),
        limit=None if max_distance is None else limit,
        tolerance=None if chord_tolerance is None else Float(chord_tolerance),
        max_chord_steps=max_chord_steps if chord_tolerance is not None else 1,
        details=details,
    )
    if surface is None:
        flight = _run(march_step, flight, enters)
    else:
        flight, chord = _run_chords(march_step, surface, flight, chord, enters)

    # ---- straight on after it has left
    ahead = dr.normalize(flight.momentum)
    n = dr.norm(flight.momentum)
    gone = active & ~chord.found & ~flight.inside  # has left, or never met the volume
    flight = _back_to_face(field, flight, ahead, n, gone & enters)
    if surface is not None:
        beyond = Chord.along(flight.position, ahead, limit - flight.path, flight.path)
        chord = chord.replaced(beyond.test(surface, gone & enters), gone & enters)
    hit, t = chord.found, chord.distance
    path = dr.select(hit, chord.start + t, dr.select(gone & (limit < dr.inf), limit, flight.path))
    turning = dr.select(flight.turning < dr.inf, flight.turning, dr.nan)
    return RayEnd(
        status=choose_status(
            types,
            active=active,
            hit=hit,
            escaped=gone & (limit == dr.inf),
            stopped=gone | march_step.at_limit(flight),
        ),
        position=dr.select(hit, chord.at(t), dr.fma(ahead, path - flight.path, flight.position)),
        direction=ahead,
        chord_origin=chord.origin,
        chord_direction=chord.direction,
        chord_length=chord.length,
        chord_start=chord.start,
        steps=flight.steps,
        path_length=path,
        optical_path=dr.fma(n, path - flight.path, flight.optical) if details else None,
        turning_height=turning if details else None,
    )


class _MarchStep:
    """One interval of the march and the conditions under which the next one follows."""

    def __init__(
        self,
        *,
        field: Field,
        stepper: Stepper,
        sigma: Any,
        step: Any,
        max_steps: Any,
        limit: Any,
        tolerance: Any,
        max_chord_steps: int,
        details: bool,
    ) -> None:
        self.field = field
        self.stepper = stepper
        self.sigma = sigma
        self.step = step
        self.max_steps = max_steps
        self.limit = limit
        self.tolerance = tolerance
        self.max_chord_steps = max_chord_steps
        self.details = details

    def advance(self, flight: _Flight, active: Any) -> _Flight:
        """The state after one more interval."""
        sigma = self.sigma
        if self.limit is not None:
            sigma = sigma * dr.minimum(1, (self.limit - flight.path) * dr.rcp(self.step))
        after = self.stepper.advance(self.field, flight.position, flight.momentum, sigma, active)
        turning = flight.turning
        if self.details:
            turning = dr.minimum(turning, _turn(flight, after.momentum, sigma))
        return _Flight(
            position=after.position,
            momentum=after.momentum,
            path=flight.path + after.length,
            optical=flight.optical + after.optical_path,
            turning=turning,
            steps=flight.steps + 1,
            inside=self.field.contains(after.position),
            chord_steps=flight.chord_steps + 1,
            chord_turn=flight.chord_turn + after.turned,
            last_turn=after.turned,
        )

    def flying(self, flight: _Flight) -> Any:
        """Whether the ray has anywhere to go and steps left to go there."""
        flying = flight.inside & (flight.steps < self.max_steps)
        return flying if self.limit is None else flying & ~self.at_limit(flight)

    def at_limit(self, flight: _Flight) -> Any:
        """Whether the ray has gone the whole distance that was asked for."""
        types = self.field.types
        if self.limit is None:
            return types.Bool(False)
        return flight.path >= self.limit * (1 - _ROUNDING[types.precision])

    def chord_holds(self, flight: _Flight, chord_start: Any) -> Any:
        """Whether one more step like the last one may share the chord that began at `chord_start`."""
        holds = flight.chord_steps < self.max_chord_steps
        if self.tolerance is not None:
            length = flight.path - chord_start + self.step
            strays = length * (flight.chord_turn + flight.last_turn) * 0.25
            holds &= strays <= self.tolerance * dr.maximum(flight.path, NEAREST)
        return holds


@dr.syntax
def _run(march_step: _MarchStep, flight: _Flight, flying: Any) -> _Flight:
    """March without testing anything."""
    while dr.hint(flying, label="march"):
        flight = march_step.advance(flight, flying)
        flying = march_step.flying(flight)
    return flight


@dr.syntax
def _run_chord(march_step: _MarchStep, flight: _Flight, flying: Any, chord_start: Any) -> _Flight:
    """March as far as one chord may span."""
    while dr.hint(flying, label="march one chord"):
        flight = march_step.advance(flight, flying)
        flying = march_step.flying(flight) & march_step.chord_holds(flight, chord_start)
    return flight


@dr.syntax
def _run_chords(
    march_step: _MarchStep, surface: Surface, flight: _Flight, chord: Chord, flying: Any
) -> tuple[_Flight, Chord]:
    """March chord after chord, each tested against the surface, until all rays have ended."""
    while dr.hint(flying, label="march chords"):
        begin = flight.position
        chord_start = flight.path
        flight = _run_chord(march_step, flight.at_new_chord(), flying, chord_start)
        piece = Chord.between(begin, flight.position, chord_start).test(surface, flying)
        chord = chord.replaced(piece, flying)
        flying = flying & ~chord.found & march_step.flying(flight)
    return flight, chord


def _turn(flight: _Flight, momentum: Any, sigma: Any) -> Any:
    """Height of an upward turn within a step: p_z taken as linear in σ; infinite if there is none."""
    falling, rising = flight.momentum.z, momentum.z
    turns = (falling < 0) & (rising >= 0)
    drop = 0.5 * sigma * falling * falling / dr.select(turns, rising - falling, 1)
    return dr.select(turns, flight.position.z - drop, dr.inf)


def _back_to_face(field: Field, flight: _Flight, ahead: Any, n: Any, left: Any) -> _Flight:
    """Take rays that have left back along their straight line to the face that they crossed."""
    back = field.entry(flight.position, -ahead)
    # A line that leaves by an edge may miss the box when followed back.
    back = dr.select(left & (back < flight.path), back, 0)
    return replace(
        flight,
        position=flight.position - ahead * back,
        path=flight.path - back,
        optical=flight.optical - n * back,
    )
