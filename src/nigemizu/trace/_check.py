"""Refusing numbers that no air over a sphere can have."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError

FloatArray: TypeAlias = NDArray[np.float64]


def numbers(
    values: ArrayLike, key: str, expected: str, *, low: float = -np.inf, high: float = np.inf
) -> FloatArray:
    """Return finite floats, all in [low, high], or raise `InputError` naming the first other."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("not a number", key=key, value=values, expected=expected) from error
    bad = ~(np.isfinite(array) & (array >= low) & (array <= high))
    if np.any(bad):
        value = float(array[bad][0])
        what = "outside the possible range" if np.isfinite(value) else "not a finite number"
        raise InputError(what, key=key, value=value, expected=expected)
    return array


def number(value: float, key: str, expected: str, *, above: float = -np.inf, high: float = np.inf) -> float:
    """Return one finite float, > `above` and ≤ `high`, or raise `InputError`."""
    array = numbers(value, key, expected, high=high)
    if array.ndim or not array > above:
        raise InputError("outside the possible range", key=key, value=value, expected=expected)
    return float(array)
