"""What the marching loop carries, and the rule of fixed intervals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Final, final

import drjit as dr

from nigemizu.field import Field
from nigemizu.trace.steppers import Stepper

__all__ = ["NEAREST", "FixedSteps", "Flight", "StepRule"]

_ROUNDING: Final = {"single": 4 * 2.0**-23, "double": 4 * 2.0**-52}
NEAREST: Final = 1.0  # m; nearer to the eye than this the chord tolerance grows no finer


@final
@dataclass
class Flight:
    """What the marching loop carries from step to step, one entry per ray."""

    position: Any  #     Array3f  m    x
    momentum: Any  #     Array3f  1    p, |p| = n
    path: Any  #         Float    m    ∫ ds so far
    optical: Any  #      Float    m    ∫ n ds so far
    turning: Any  #      Float    m    least height of an upward turn (without details: of a step's end)
    steps: Any  #        UInt32   1    steps made, rejected ones included
    inside: Any  #       Bool          still in the volume
    trial: Any  #        Float    m    interval of σ to be tried next (controlled steps)
    error: Any  #        Float    rad  sum of the estimated errors of the steps (controlled steps)
    chord_steps: Any  #  UInt32   1    steps since the chord began
    chord_length: Any  # Float    m    length of the path since the chord began
    chord_turn: Any  #   Float    rad  bound of the angle turned since the chord began
    last_turn: Any  #    Float    rad  the same of the last step alone
    last_length: Any  #  Float    m    length of the last step

    @classmethod
    def begin(
        cls, field: Field, position: Any, direction: Any, straight: Any, inside: Any, trial: Any
    ) -> Flight:
        """A ray that begins in the volume after a straight way [m], with its first interval [m of σ]."""
        types = field.types
        Float, UInt32 = types.Float, types.UInt32
        n, _ = field.value_and_gradient(position, inside)
        n = dr.select(inside, n, 1)
        return cls(
            position=types.Array3f(position),
            # Opaque: a component known to be 0 may not stay so, as the loops' recording would have it.
            momentum=types.Array3f(direction * n + dr.opaque(Float, 0)),
            path=Float(straight),
            optical=Float(straight * n),
            turning=Float(dr.inf),
            steps=UInt32(0),
            inside=types.Bool(inside),
            trial=Float(trial),
            error=Float(0),
            chord_steps=UInt32(0),
            chord_length=Float(0),
            chord_turn=Float(0),
            last_turn=Float(0),
            last_length=Float(0),
        )

    def at_new_chord(self) -> Flight:
        """The same ray, about to begin a chord."""
        return replace(
            self,
            chord_steps=self.chord_steps * 0,
            chord_length=self.chord_length * 0,
            chord_turn=self.chord_turn * 0,
        )


class StepRule(ABC):
    """One interval of the march and the conditions under which the next one follows.

    Parameters
    ----------
    field : Field
    max_steps : UInt32
    limit : Float or None, m
        Path length at which a ray stops.
    chord_tolerance : Float or None, rad
        How far a chord may stray from the ray, seen from its origin; None: every step is a chord.
    max_chord_steps : int
    details : bool
        Whether turning points are looked for.
    """

    def __init__(
        self,
        field: Field,
        *,
        max_steps: Any,
        limit: Any,
        chord_tolerance: Any,
        max_chord_steps: int,
        details: bool,
    ) -> None:
        self.field = field
        self.max_steps = max_steps
        self.limit = limit
        self.chord_tolerance = chord_tolerance
        self.max_chord_steps = max_chord_steps if chord_tolerance is not None else 1
        self.details = details

    @abstractmethod
    def advance(self, flight: Flight, active: Any) -> Flight:
        """The state after one more interval."""

    def flying(self, flight: Flight) -> Any:
        """Whether the ray has anywhere to go and steps left to go there."""
        flying = flight.inside & (flight.steps < self.max_steps)
        return flying if self.limit is None else flying & ~self.at_limit(flight)

    def at_limit(self, flight: Flight) -> Any:
        """Whether the ray has gone the whole distance that was asked for."""
        types = self.field.types
        if self.limit is None:
            return types.Bool(False)
        return flight.path >= self.limit * (1 - _ROUNDING[types.precision])

    def chord_holds(self, flight: Flight) -> Any:
        """Whether one more step like the last one may share the chord."""
        holds = flight.chord_steps < self.max_chord_steps
        if self.chord_tolerance is not None:
            length = flight.chord_length + flight.last_length
            strays = length * (flight.chord_turn + flight.last_turn) * 0.25
            holds &= strays <= self.chord_tolerance * dr.maximum(flight.path, NEAREST)
        return holds


@final
class FixedSteps(StepRule):
    """The paper's rule: intervals of one length.

    Parameters
    ----------
    field, options
        As in `StepRule`.
    stepper : Stepper
    step : Float, m
        The interval where the index is that at the ray's first point.
    sigma : Float, m
        The same as an interval of σ.
    """

    def __init__(self, field: Field, *, stepper: Stepper, step: Any, sigma: Any, **options: Any) -> None:
        super().__init__(field, **options)
        self.stepper = stepper
        self.step = step
        self.sigma = sigma

    def advance(self, flight: Flight, active: Any) -> Flight:
        sigma = self.sigma
        if self.limit is not None:
            sigma = sigma * dr.minimum(1, (self.limit - flight.path) * dr.rcp(self.step))
        after = self.stepper.advance(self.field, flight.position, flight.momentum, sigma, active)
        turning = flight.turning
        if self.details:
            turning = dr.minimum(turning, _turn(flight, after.momentum, sigma))
        return Flight(
            position=after.position,
            momentum=after.momentum,
            path=flight.path + after.length,
            optical=flight.optical + after.optical_path,
            turning=turning,
            steps=flight.steps + 1,
            inside=self.field.contains(after.position),
            trial=flight.trial,
            error=flight.error,
            chord_steps=flight.chord_steps + 1,
            chord_length=flight.chord_length + after.length,
            chord_turn=flight.chord_turn + after.turned,
            last_turn=after.turned,
            last_length=after.length,
        )


def _turn(flight: Flight, momentum: Any, sigma: Any) -> Any:
    """Height of an upward turn within a step: p_z taken as linear in σ; infinite if there is none."""
    falling, rising = flight.momentum.z, momentum.z
    turns = (falling < 0) & (rising >= 0)
    drop = 0.5 * sigma * falling * falling / dr.select(turns, rising - falling, 1)
    return dr.select(turns, flight.position.z - drop, dr.inf)
