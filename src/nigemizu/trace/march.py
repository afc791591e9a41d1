"""The bent ray: marching through a refractive-index field until it meets a surface or leaves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import drjit as dr

from nigemizu.errors import InputError
from nigemizu.field import Field
from nigemizu.trace.chords import Chord
from nigemizu.trace.controlled import FIRST_TRIAL, ControlledSteps
from nigemizu.trace.ends import RayEnd, choose_status
from nigemizu.trace.steppers import LEAPFROG, Stepper
from nigemizu.trace.stepping import FixedSteps, Flight, StepRule
from nigemizu.trace.surfaces import Surface

__all__ = ["march", "run"]

_CHORDS: Final = 0.1  # of the accuracy, that chords may use up where nothing is said


def march(
    field: Field,
    origin: Any,
    direction: Any,
    *,
    accuracy: Any = None,
    step: Any = None,
    max_steps: Any,
    stepper: Stepper = LEAPFROG,
    surface: Surface | None = None,
    chord_tolerance: Any = None,
    max_chord_steps: int = 32,
    travelled: Any = 0.0,
    max_distance: Any = None,
    cellwise: bool = True,
    trial: Any = FIRST_TRIAL,
    details: bool = False,
    active: Any = True,
) -> RayEnd:
    """March rays through a field.

    Parameters
    ----------
    field : Field
    origin : Array3f, m
    direction : Array3f, 1 — unit length
    accuracy : float or Float, rad
        Displacement, seen from the ray's origin, that the integration may add: steps are controlled by
        their estimated error.
    step : float or Float, m
        In place of the accuracy, the paper's fixed interval along the ray between turns. It is exact where
        the index is that at the ray's first point in the volume, and n/n₀ times as long elsewhere.
    max_steps : int or UInt32
        Most intervals that a ray may use.
    stepper : Stepper
        Rule of fixed intervals.
    surface : callable, optional
        ``surface(origin, direction, length, active) -> (hit, distance)``.
    chord_tolerance : float or Float, optional, rad
        How far a tested chord may lie from the bent ray, as an angle seen from the ray's origin (a
        fraction of a pixel). The number 0 tests after every step, however long. By default a tenth of the
        accuracy; fixed steps are tested one by one.
    max_chord_steps : int
        Most steps that share a chord.
    travelled : Float, m
        Path length that lies behind the origin already; all path lengths count from its beginning.
    max_distance : Float, optional, m
        Path length at which a ray stops; the last step is shortened to it.
    cellwise : bool
        Whether controlled steps end at the faces of cells (`ControlledSteps`).
    trial : Float, m
        Interval of σ that controlled steps try first.
    details : bool
        Also sum the optical path and look for turning points.
    active : Bool
        Rays that take part.

    Returns
    -------
    RayEnd

    Raises
    ------
    InputError
        Unless exactly one of `accuracy` and `step` is given.

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

    The call may be nested in a symbolic loop. A fixed step in which a ray leaves the volume is bent wholly
    or not at all: a first-order error, but only of that one step. Controlled steps (`ControlledSteps`)
    end at the face.

    Limits: light is geometric; fixed steps must be short against the length over which the gradient
    changes. The estimates of controlled steps are local: what is amplified later on the way counts once.

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
    >>> end = trace.march(air, eye, ahead, accuracy=1e-7, max_steps=1000, details=True)
    >>> round(float(end.turning_height[0]), 3)
    0.126
    """
    types = field.types
    Float, Array3f, UInt32, Bool = types.Float, types.Array3f, types.UInt32, types.Bool
    if (accuracy is None) == (step is None):
        raise InputError("give the accuracy of the rays or a fixed step, one of them", key="accuracy")
    origin, d, active = Array3f(origin), Array3f(direction), Bool(active)
    limit = Float(dr.inf if max_distance is None else max_distance)

    # ---- straight to the volume
    before = Float(travelled)
    entry = field.entry(origin, d)
    enters = active & (entry < limit - before)
    start = dr.select(enters, entry, 0)

    # ---- bent inside
    x = Array3f(dr.fma(d, start, origin))
    flight = Flight.begin(field, x, d, start, enters, trial)
    flight = replace(flight, path=flight.path + before)
    options = {
        "max_steps": UInt32(max_steps),
        "limit": None if max_distance is None else limit,
        "chord_tolerance": None if surface is None else _chord_tolerance(Float, chord_tolerance, accuracy),
        "max_chord_steps": max_chord_steps,
        "details": details,
    }
    rule: StepRule
    if step is None:
        rule = ControlledSteps(field, accuracy=Float(accuracy), cellwise=cellwise, **options)
    else:
        sigma = Float(step) / dr.norm(flight.momentum)
        rule = FixedSteps(field, stepper=stepper, step=Float(step), sigma=sigma, **options)
    queries = UInt32(0)
    chord = Chord.along(origin, d, Float(0), before, blank=getattr(surface, "blank", None))
    if surface is None:
        flight = run(rule, flight, enters)
    else:
        approach = Chord.along(origin, d, dr.minimum(entry, limit - before), before)
        flight, chord, queries = _run_chords(
            rule, surface, flight, chord, queries, active, active & (entry > 0), approach, limit
        )

    # ---- straight on after it has left
    ahead = dr.normalize(flight.momentum)
    n = dr.norm(flight.momentum)
    gone = active & ~chord.found & ~flight.inside  # has left, or never met the volume
    flight = _back_to_face(field, flight, ahead, n, gone & enters)
    hit, t = chord.found, chord.distance
    path = dr.select(hit, chord.start + t, dr.select(gone & (limit < dr.inf), limit, flight.path))
    turning = dr.select(flight.turning < dr.inf, flight.turning, dr.nan)
    return RayEnd(
        status=choose_status(
            types,
            active=active,
            hit=hit,
            escaped=gone & (limit == dr.inf),
            stopped=gone | rule.at_limit(flight),
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
        error=flight.error if step is None else None,
        queries=queries,
        mark=chord.mark,
        trial=flight.trial,
    )


def _chord_tolerance(Float: Any, given: Any, accuracy: Any) -> Any:
    """The tolerance on the device; None where every step is tested."""
    if given is None:
        return None if accuracy is None else Float(accuracy) * _CHORDS
    return None if isinstance(given, int | float) and given == 0 else Float(given)


@dr.syntax
def run(rule: StepRule, flight: Flight, flying: Any) -> Flight:
    """March without testing anything."""
    while dr.hint(flying, label="march"):
        flight = rule.advance(flight, flying)
        flying = rule.flying(flight)
    return flight


@dr.syntax
def _run_chord(rule: StepRule, flight: Flight, flying: Any) -> Flight:
    """March as far as one chord may span."""
    while dr.hint(flying, label="march one chord"):
        flight = rule.advance(flight, flying)
        flying = rule.flying(flight) & rule.chord_holds(flight)
    return flight


@dr.syntax
def _run_chords(
    rule: StepRule,
    surface: Surface,
    flight: Flight,
    chord: Chord,
    queries: Any,
    flying: Any,
    waiting: Any,
    approach: Chord,
    limit: Any,
) -> tuple[Flight, Chord, Any]:
    """Piece after piece, each tested against the surface: the approach of rays that wait outside, chords
    within the volume, and the way on from where a ray has left it."""
    while dr.hint(flying, label="march chords"):
        begin, chord_start, marches = flight.position, flight.path, flying & ~waiting & flight.inside
        flight = _run_chord(rule, flight.at_new_chord(), marches)
        piece = Chord.between(begin, flight.position, chord_start)
        onward = Chord.along(begin, dr.normalize(flight.momentum), limit - chord_start, chord_start)
        piece = approach.replaced(onward.replaced(piece, marches), ~waiting).test(surface, flying)
        queries += 1
        chord = chord.replaced(piece, flying)
        # After the approach come the rays that enter, and after the last chord those that have left.
        leaves = ~flight.inside & (flight.path < limit)
        goes_on = dr.select(waiting, flight.inside, marches & (rule.flying(flight) | leaves))
        flying = flying & ~chord.found & goes_on
        waiting = waiting & ~flying
    return flight, chord, queries


def _back_to_face(field: Field, flight: Flight, ahead: Any, n: Any, left: Any) -> Flight:
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
