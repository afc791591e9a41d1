"""Steppers for Hamilton's ray equations: compositions of straight drifts and kicks, as data.

With the parameter σ, ds = n dσ, a ray obeys dx/dσ = p, dp/dσ = n ∇n, |p| = n. Each half is solved
exactly when the other rests: a drift x += a Δσ p, a kick p += b Δσ n∇n(x). A stepper is the list of the
a and b.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, Final, final

import drjit as dr

from nigemizu.errors import InputError
from nigemizu.field import Field

__all__ = ["EULER", "LEAPFROG", "STEPPERS", "SUZUKI4", "YOSHIDA4", "StepResult", "Stepper", "stepper_named"]


@final
@dataclass
class StepResult:
    """One step: new position [m] and momentum [1], and what it adds to path length [m], optical path [m]
    and the bound of the turned angle [rad]."""

    position: Any
    momentum: Any
    length: Any
    optical_path: Any
    turned: Any


@final
@dataclass(frozen=True)
class Stepper:
    """Weights of drift, kick, drift, …, kick, drift; each kind adds up to 1.

    Attributes
    ----------
    name : str
    order : int
        Order of convergence in the step, in smooth fields.
    drifts : tuple of float
    kicks : tuple of float
        One fewer than `drifts`; as many field look-ups per step.

    Notes
    -----
    All such compositions are symplectic: over long paths the Hamiltonian ``|p|² − n²`` wavers but does not
    drift. In air that is stratified along z they keep the horizontal momentum, Snell's invariant, to
    round-off. Those that read the same backwards are reversible to round-off.

    References
    ----------
    Yoshida (1990), doi:10.1016/0375-9601(90)90092-3; Suzuki (1990), doi:10.1016/0375-9601(90)90962-N.
    """

    name: str
    order: int
    drifts: tuple[float, ...]
    kicks: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.drifts) != len(self.kicks) + 1:
            raise InputError("a stepper needs one drift more than kicks", key=self.name)
        if abs(sum(self.drifts) - 1) > 1e-12 or abs(sum(self.kicks) - 1) > 1e-12:
            raise InputError("the weights of a stepper do not add up to 1", key=self.name)

    @property
    def reversed(self) -> Stepper:
        """The stepper that, with −Δσ, exactly undoes this one."""
        return Stepper(f"{self.name}-reversed", self.order, self.drifts[::-1], self.kicks[::-1])

    def advance(
        self, field: Field, position: Any, momentum: Any, sigma: Any, active: Any = True
    ) -> StepResult:
        """One step of Δσ = `sigma` [m].

        Symbols: x position, p momentum, a and b weights of drift and kick, n index, f = n ∇n.
        """
        Array3f, Float = field.types.Array3f, field.types.Float
        x, p = Array3f(position), Array3f(momentum)
        length, optical_path, turned = Float(0), Float(0), Float(0)
        for a, b in zip(self.drifts, (*self.kicks, 0.0), strict=True):
            if a != 0:
                x = dr.fma(p, sigma * a, x)
            if b != 0:
                n, gradient = field.value_and_gradient(x, active)
                kick = gradient * (n * (sigma * b))
                p = p + kick
                length = dr.fma(n, sigma * b, length)
                optical_path = dr.fma(n * n, sigma * b, optical_path)
                # the sum of the components' sizes bounds the vector's; divided by |p| = n it bounds the angle
                turned = turned + (abs(kick.x) + abs(kick.y) + abs(kick.z)) / n
        return StepResult(x, p, length, optical_path, turned)


def _composed(name: str, order: int, parts: tuple[float, ...]) -> Stepper:
    """Leapfrogs of the given relative lengths, one after another, neighbouring drifts joined."""
    drifts = [parts[0] / 2]
    drifts += [(one + two) / 2 for one, two in itertools.pairwise(parts)]
    drifts += [parts[-1] / 2]
    return Stepper(name, order, tuple(drifts), parts)


_Y = 1 / (2 - 2 ** (1 / 3))
_S = 1 / (4 - 4 ** (1 / 3))

EULER: Final = Stepper("euler", 1, (0.0, 1.0), (1.0,))
"""The paper's plain rule: turn by the gradient at the point, then go straight for one interval."""
LEAPFROG: Final = Stepper("leapfrog", 2, (0.5, 0.5), (1.0,))
"""Half a drift, a kick, half a drift: second order for one look-up."""
YOSHIDA4: Final = _composed("yoshida4", 4, (_Y, 1 - 2 * _Y, _Y))
"""Fourth order with three look-ups."""
SUZUKI4: Final = _composed("suzuki4", 4, (_S, _S, 1 - 4 * _S, _S, _S))
"""Fourth order with five look-ups and a far smaller error constant."""

STEPPERS: Final = {stepper.name: stepper for stepper in (EULER, LEAPFROG, YOSHIDA4, SUZUKI4)}


def stepper_named(name: str) -> Stepper:
    """The stepper of this name (``euler``, ``leapfrog``, ``yoshida4``, ``suzuki4``)."""
    if name not in STEPPERS:
        raise InputError("no such stepper", key="stepper", value=name, expected=", ".join(STEPPERS))
    return STEPPERS[name]
