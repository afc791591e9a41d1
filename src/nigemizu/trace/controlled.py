"""Steps as long as the field allows: error-controlled, and from cell to cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, final

import drjit as dr

from nigemizu.field import Cell, Field
from nigemizu.trace.stepping import NEAREST, Flight, StepRule

__all__ = ["FIRST_TRIAL", "ControlledSteps"]

FIRST_TRIAL: Final = 8.0  # m of σ; wrong guesses cost a rejected step
_SHARE: Final = 0.1  # of the accuracy that one step may use up
_GROWTH, _SHRINKAGE, _CAUTION = 5.0, 0.1, 0.85  # of the step, from one to the next
_BEND_IN_CELL: Final = 0.25  # of a cell's width, that a step may stray sideways from its straight line
_CHORD_SLACK: Final = 1.2  # that a step's chord may stray more than foreseen
_OVERSHOOT: Final = 1 + 1e-5  # relative, so that a step ends beyond the face and not just before it
_ASTRAY: Final = 0.05  # of a cell's height, that a step may end above or below the cell
_ULPS: Final = 64  # a step is never shorter than so many spacings of the coordinates' numbers
_TINY: Final = 1e-20  # in place of zero, where it divides
_FARTHEST: Final = 1e30  # m; in place of infinity, whose products may not be numbers
_NEWTON: Final = 4  # iterations for the lowest point within a step


@final
@dataclass
class _Trial:
    """A step that was tried: slopes f = n∇n at its beginning, middle and end, and where it leads."""

    h: Any  #         Float    m    interval of σ
    slopes: Any  #    3 × Array3f  1/m
    indices: Any  #   3 × Float    1
    position: Any  #  Array3f  m
    momentum: Any  #  Array3f  1
    error: Any  #     Float    rad  estimated error of the direction
    turned: Any  #    Float    rad  bound of the angle by which it turns


@final
class ControlledSteps(StepRule):
    """Nyström's method of fourth order, with steps from an estimate of their error.

    Parameters
    ----------
    field, options
        As in `StepRule`.
    accuracy : Float, rad
        Displacement, seen from the ray's origin, that the integration may add.
    cellwise : bool
        Whether steps end where cells do. Without, only the estimate of the error limits them, which is
        quicker on short pieces of a ray whose curvature is known to be looked at.

    Notes
    -----
    In σ, ds = n dσ, the ray obeys x″ = f(x) = n∇n, which does not contain the velocity. For such
    equations Nyström's three slopes k₀, k₁, k₂ (beginning, middle, end) give position and momentum to
    fourth order. The difference to the midpoint rule, e = h/6 (k₀ − 2k₁ + k₂), is the error of second
    order; that of fourth is taken as |e|²/(h|k₁|). It is a guide for the step, not a bound of the error:
    measured, it is between a third and five times the error of one step. A step whose estimate exceeds a
    tenth of the accuracy is tried again, shorter.

    A step ends at the latest where the piece of the field ends in which one formula holds (`Field.cell`):
    there the gradient of a trilinear volume jumps, and within it three slopes are all but exact. The way
    to the floor and the ceiling of a cell is that of the parabola, so that a ray that turns within a cell
    is seen to turn. A field may also limit steps to what it can promise that nothing is overlooked
    (`Cell.reach`).

    References
    ----------
    E. J. Nyström (1925), Über die numerische Integration von Differentialgleichungen, Acta Societatis
    Scientiarum Fennicae 50(13); E. Hairer, S. P. Nørsett, G. Wanner (1993), Solving Ordinary Differential
    Equations I, section II.14, doi:10.1007/978-3-540-78862-1.
    """

    def __init__(self, field: Field, *, accuracy: Any, cellwise: bool = True, **options: Any) -> None:
        super().__init__(field, **options)
        self.accuracy = accuracy
        self.cellwise = cellwise
        self.spacing = 2.0**-23 if field.types.precision == "single" else 2.0**-52

    def advance(self, flight: Flight, active: Any) -> Flight:
        x, p = flight.position, flight.momentum
        if self.cellwise:
            cell = self.field.cell(x, p, active)
        else:
            cell = Cell(lambda point: self.field.value_and_gradient(point, active))
        n0, gradient = cell.value_and_gradient(x)
        k0 = gradient * n0
        least = _ULPS * self.spacing * dr.maximum(dr.max(abs(x)), NEAREST)
        h = dr.minimum(flight.trial, self._allowed(cell, flight, k0))
        if self.limit is not None:
            h = dr.minimum(h, (self.limit - flight.path) * dr.rcp(n0))
        h = dr.maximum(h, least)
        tried = self._try(cell, x, p, h, n0, k0)

        # ---- accepted or tried again, and how long the next one is
        worse = dr.maximum(tried.error * dr.rcp(self.accuracy * _SHARE), 1e-6)
        passes = worse <= 1
        factor = dr.clip(_CAUTION * dr.sqrt(dr.rsqrt(worse)), _SHRINKAGE, _GROWTH)
        if self.chord_tolerance is not None:
            strays = self._strays(flight, tried)
            passes &= strays <= 1
            factor = dr.select(strays <= 1, factor, dr.minimum(factor, _CAUTION * dr.rsqrt(strays)))
        if cell.lower is not None and cell.upper is not None:
            astray = self._ends_astray(cell, tried.position.z)
            passes &= ~astray
            factor = dr.select(astray, dr.minimum(factor, 0.5), factor)
        passes |= h <= least
        cut = passes & (h < flight.trial) & (factor >= 1)
        trial = dr.select(cut, dr.maximum(h * factor, flight.trial), h * factor)
        return self._after(flight, tried, passes, trial)

    def _allowed(self, cell: Cell, flight: Flight, k0: Any) -> Any:
        """Longest interval of σ [m] that cell, reach and chord permit."""
        Float = self.field.types.Float
        x, p = flight.position, flight.momentum
        allowed = Float(dr.inf)
        if cell.lower is not None and cell.upper is not None:
            for axis in (0, 1):
                ahead = dr.select(p[axis] > 0, cell.upper[axis] - x[axis], x[axis] - cell.lower[axis])
                allowed = dr.minimum(allowed, ahead * dr.rcp(dr.maximum(abs(p[axis]), _TINY)))
            width = dr.minimum(cell.upper.x - cell.lower.x, cell.upper.y - cell.lower.y)
            sideways = dr.maximum(dr.maximum(abs(k0.x), abs(k0.y)), _TINY)
            allowed = dr.minimum(allowed, dr.sqrt(2 * _BEND_IN_CELL * width * dr.rcp(sideways)))
            up = _crossing(cell.upper.z - x.z, p.z, k0.z)
            down = _crossing(x.z - cell.lower.z, -p.z, -k0.z)
            allowed = dr.minimum(allowed, dr.minimum(up, down)) * _OVERSHOOT
        if cell.reach is not None:
            allowed = dr.minimum(allowed, cell.reach * dr.rsqrt(dr.squared_norm(p)))
        if self.chord_tolerance is not None:
            allowed = dr.minimum(allowed, self._chord_room(flight, k0))
        return allowed

    @staticmethod
    def _ends_astray(cell: Cell, height: Any) -> Any:
        """Whether a step ended far beyond the cell, where its formula does not hold.

        A ray that dips into steeper layers comes up again sooner than the parabola from its first slope.
        """
        beyond = dr.maximum(height - cell.upper.z, cell.lower.z - height)
        return beyond > _ASTRAY * (cell.upper.z - cell.lower.z)

    def _chord_room(self, flight: Flight, k0: Any) -> Any:
        """Interval h after which the chord lies within the tolerance still, if the ray turns as it does here.

        An arc of length L that turns by θ strays by Lθ/8: h solves (L + h)(θ + κh) = 8 × tolerance.
        """
        sharpness = _size(k0)
        L, turn = flight.chord_length, flight.chord_turn
        room = 8 * self.chord_tolerance * dr.maximum(flight.path, NEAREST) - L * turn
        room = dr.maximum(room, 0)
        linear = dr.fma(L, sharpness, turn)
        root = dr.sqrt(dr.fma(linear, linear, 4 * sharpness * room))
        return 2 * room * dr.rcp(dr.maximum(linear + root, _TINY))

    def _strays(self, flight: Flight, tried: _Trial) -> Any:
        """How far the chord strays after the step, in units of what it may."""
        allowed = _CHORD_SLACK * 8 * self.chord_tolerance * dr.maximum(flight.path, NEAREST)
        return (flight.chord_length + tried.h) * (flight.chord_turn + tried.turned) * dr.rcp(allowed)

    def _try(self, cell: Cell, x: Any, p: Any, h: Any, n0: Any, k0: Any) -> _Trial:
        half = 0.5 * h
        n1, gradient = cell.value_and_gradient(dr.fma(k0, 0.5 * half * half, dr.fma(p, half, x)))
        k1 = gradient * n1
        n2, gradient = cell.value_and_gradient(dr.fma(k1, 0.5 * h * h, dr.fma(p, h, x)))
        k2 = gradient * n2
        middling = (k0 - 2 * k1 + k2) * (h / 6)
        second = _size(middling)
        kick = h * _size(k1)
        return _Trial(
            h=h,
            slopes=(k0, k1, k2),
            indices=(n0, n1, n2),
            position=dr.fma(k0 + 2 * k1, h * h / 6, dr.fma(p, h, x)),
            momentum=dr.fma(k0 + 4 * k1 + k2, h / 6, p),
            turned=(_size(k0) + 4 * _size(k1) + _size(k2)) * (h / 6),
            error=second * dr.minimum(1, second * dr.rcp(dr.maximum(kick, _TINY))),
        )

    def _after(self, flight: Flight, tried: _Trial, passes: Any, trial: Any) -> Flight:
        h, (n0, n1, n2) = tried.h, tried.indices
        length = (n0 + 4 * n1 + n2) * (h / 6)
        turned = tried.turned
        position = dr.select(passes, tried.position, flight.position)
        turning = flight.turning
        if self.details:
            turning = dr.minimum(turning, dr.select(passes, _lowest(flight, tried), dr.inf))
        else:
            # Nobody asks for turns: the least height of all steps' ends is kept in the same place.
            turning = dr.minimum(turning, position.z)
        made = dr.select(passes, type(flight.steps)(1), type(flight.steps)(0))
        return Flight(
            position=position,
            momentum=dr.select(passes, tried.momentum, flight.momentum),
            path=flight.path + dr.select(passes, length, 0),
            optical=flight.optical + dr.select(passes, (n0 * n0 + 4 * n1 * n1 + n2 * n2) * (h / 6), 0),
            turning=turning,
            steps=flight.steps + 1,
            # At the face itself rounding may have it outside before the first step.
            inside=dr.select(passes, self.field.contains(position), flight.inside),
            trial=trial,
            error=flight.error + dr.select(passes, tried.error, 0),
            chord_steps=flight.chord_steps + made,
            chord_length=flight.chord_length + dr.select(passes, length, 0),
            chord_turn=flight.chord_turn + dr.select(passes, turned, 0),
            last_turn=dr.select(passes, turned, flight.last_turn),
            last_length=dr.select(passes, length, flight.last_length),
        )


def _size(vector: Any) -> Any:
    """Sum of the sizes of the components, which bounds the vector's."""
    return abs(vector.x) + abs(vector.y) + abs(vector.z)


def _crossing(distance: Any, speed: Any, pull: Any) -> Any:
    """First σ > 0 at which v σ + a σ²/2 reaches the distance; infinite if it never does."""
    distance = dr.clip(distance, 0, _FARTHEST)
    discriminant = dr.fma(speed, speed, 2 * pull * distance)
    root = dr.sqrt(dr.maximum(discriminant, 0))
    # The form that does not subtract equal numbers; going away, only a pull brings it back.
    onward = 2 * distance * dr.rcp(dr.maximum(speed + root, _TINY))
    back = (root - speed) * dr.rcp(dr.select(pull > 0, pull, 1))
    reached = dr.select(speed >= 0, discriminant >= 0, pull > 0)
    return dr.select(reached, dr.select(speed >= 0, onward, back), dr.inf)


def _lowest(flight: Flight, tried: _Trial) -> Any:
    """Height of an upward turn within a step; infinite if there is none.

    With slopes f that are quadratic in θ = σ/h, p_z is a cubic whose root Newton's method finds.
    """
    h, (k0, k1, k2) = tried.h, (k.z for k in tried.slopes)
    falling, rising = flight.momentum.z, tried.momentum.z
    turns = (falling < 0) & (rising >= 0)
    # f(θ) = k₀ + b θ + 2c θ²
    b, c = 4 * k1 - 3 * k0 - k2, k0 - 2 * k1 + k2
    t = dr.clip(-falling / dr.select(turns, rising - falling, 1), 0, 1)
    for _ in range(_NEWTON):
        speed = falling + h * t * (k0 + t * (b / 2 + t * (2 * c / 3)))
        slope = h * (k0 + t * (b + t * (2 * c)))
        t = dr.clip(t - dr.select(slope > 0, speed / dr.select(slope > 0, slope, 1), 0), 0, 1)
    height = flight.position.z + h * t * (falling + h * t * (k0 / 2 + t * (b / 6 + t * (c / 6))))
    return dr.select(turns, height, dr.inf)
