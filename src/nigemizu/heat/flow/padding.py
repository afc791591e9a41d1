"""The two cells of padding around every array: what lies beyond sides, ground and top."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

__all__ = ["PAD", "pad_ends", "pad_sides", "padded"]

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
