"""The two cells of padding around every array: what lies beyond sides, ground and top."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, final

import numpy as np

__all__ = ["PAD", "Padding", "pad_ends", "pad_sides", "padded"]

PAD: Final = 2


def padded(shape: tuple[int, int, int]) -> np.ndarray:
    """Zeros with padding on every side."""
    return np.zeros(tuple(count + 2 * PAD for count in shape))


def pad_sides(
    values: Any, axis: int, kind: str, sign: float, held: tuple[float, float] | None = None
) -> None:
    """Fill the padding beyond the sides along an axis (1: y, 2: x).

    Parameters
    ----------
    values : (nz + 4, ny + 4, nx + 4) float64
    axis : int
    kind : {"periodic", "centre", "face"}
        Periodic; or a wall, with values at the centres of cells, or on faces along the axis (the first lies
        on one wall, the first of the padding on the other).
    sign : float
        1 mirrors at a wall, −1 mirrors with the opposite sign.
    held : (float, float), optional
        Values at the walls, for centres: the mirror image lies as far on their other side.
    """
    moved = np.moveaxis(values, axis, 0)
    count = len(moved) - 2 * PAD
    if kind == "periodic":
        # of one cell alone there are copies on all sides
        for ghost in range(PAD):
            moved[ghost] = moved[PAD + (ghost - PAD) % count]
            moved[PAD + count + ghost] = moved[PAD + ghost % count]
        return
    if kind == "face":
        first, last = PAD, PAD + count
        moved[last] = moved[first] = 0.0
        for ghost in (1, 2):
            moved[first - ghost] = sign * moved[min(first + ghost, last)]
        moved[last + 1] = sign * moved[max(last - 1, first)]
        return
    lower, upper = (0.0, 0.0) if held is None else (2.0 * held[0], 2.0 * held[1])
    for ghost in range(PAD):
        within = min(ghost, count - 1)
        moved[PAD - 1 - ghost] = lower + sign * moved[PAD + within]
        moved[PAD + count + ghost] = upper + sign * moved[PAD + count - 1 - within]


def pad_ends(values: Any, sign_below: float, sign_above: float) -> None:
    """Mirror values at the centres of cells beyond ground and top, with these signs."""
    count = len(values) - 2 * PAD
    for ghost in range(PAD):
        within = min(ghost, count - 1)
        values[PAD - 1 - ghost] = sign_below * values[PAD + within]
        values[PAD + count + ghost] = sign_above * values[PAD + count - 1 - within]


@final
class Padding:
    """What lies beyond sides, ground and top of a flow.

    Parameters
    ----------
    walls : (bool, bool)
        Whether the sides along x and y are walls; else periodic.
    slips : (bool, bool, bool)
        Whether the air slips along such walls, along the ground, and along the top.
    held : mapping
        Temperatures [K] of the two walls along "x" or "y", which are insulated otherwise.
    """

    def __init__(
        self,
        walls: tuple[bool, bool],
        slips: tuple[bool, bool, bool],
        held: Mapping[str, tuple[float, float]],
    ) -> None:
        self._walls, self._held = walls, held
        self._sides, self._below, self._above = (1.0 if slip else -1.0 for slip in slips)

    def fill(self, u: Any, v: Any, w: Any, warmth: Any) -> None:
        """The padding of all fields; velocities through walls, ground and top become 0."""
        for axis, wall, name, normal in ((2, self._walls[0], "x", u), (1, self._walls[1], "y", v)):
            for field in (u, v, w):
                kind = "periodic" if not wall else "face" if field is normal else "centre"
                pad_sides(field, axis, kind, -1.0 if field is normal else self._sides)
            held = self._held.get(name)
            pad_sides(warmth, axis, "centre" if wall else "periodic", 1.0 if held is None else -1.0, held)
        pad_ends(u, self._below, self._above)
        pad_ends(v, self._below, self._above)
        pad_ends(warmth, 1.0, 1.0)
        top = len(w) - PAD
        w[PAD] = w[top] = 0.0
        for ghost in (1, 2):
            w[PAD - ghost] = -w[min(PAD + ghost, top)]
        w[top + 1] = -w[top - 1]

    def close(self, u: Any, v: Any, w: Any) -> None:
        """No more of it than what the divergence of the cells needs: the last faces along each axis."""
        for axis, wall, field in ((2, self._walls[0], u), (1, self._walls[1], v)):
            moved = np.moveaxis(field, axis, 0)
            if wall:
                moved[PAD] = 0.0
            moved[-PAD] = moved[PAD]
        w[PAD] = w[-PAD] = 0.0

    def fill_viscosity(self, nu: Any) -> None:
        """That of the viscosity."""
        for axis, wall in ((2, self._walls[0]), (1, self._walls[1])):
            pad_sides(nu, axis, "centre" if wall else "periodic", 1.0)
        pad_ends(nu, 1.0, 1.0)
