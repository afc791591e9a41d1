"""Refusing input that no air can have."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError


def checked(
    values: ArrayLike,
    key: str,
    expected: str,
    *,
    above: float = -np.inf,
    low: float = -np.inf,
    high: float = np.inf,
) -> NDArray[np.float64]:
    """Return floats, all in [low, high] and > `above`, or raise `InputError` naming the first other.

    NaN never passes. Costs two passes over the array and no temporary when all is well.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("not a number", key=key, value=values, expected=expected) from error
    if array.size == 0:
        return array
    smallest, largest = array.min(), array.max()  # either is NaN if any value is
    if smallest > above and smallest >= low and largest <= high and np.isfinite(largest):
        return array
    bad = ~(np.isfinite(array) & (array > above) & (array >= low) & (array <= high))
    where = np.argwhere(bad)[0]
    value = float(array[tuple(where)])
    what = "not a finite number" if not np.isfinite(value) else "outside the possible range"
    place = f" at index {tuple(int(i) for i in where)} and {int(bad.sum()) - 1} more" if array.ndim else ""
    raise InputError(f"{what}{place}", key=key, value=value, expected=expected)


def kelvin(temperature: ArrayLike) -> NDArray[np.float64]:
    """Return a temperature in K, or raise `InputError` unless it is finite and positive."""
    return checked(temperature, "temperature", "kelvin above 0", above=0.0)


def pascal(pressure: ArrayLike) -> NDArray[np.float64]:
    """Return a pressure in Pa, or raise `InputError` unless it is finite and positive."""
    return checked(pressure, "pressure", "pascal above 0", above=0.0)


def humidity(relative_humidity: ArrayLike) -> NDArray[np.float64]:
    """Return a relative humidity, or raise `InputError` unless it lies in [0, 1]."""
    return checked(relative_humidity, "relative_humidity", "a fraction from 0 to 1", low=0.0, high=1.0)


def co2(co2_fraction: ArrayLike) -> NDArray[np.float64]:
    """Return a CO2 mole fraction, or raise `InputError` unless it lies in [0, 0.1]."""
    return checked(
        co2_fraction, "co2_fraction", "a mole fraction from 0 to 0.1 (450 ppm is 450e-6)", low=0.0, high=0.1
    )


def one_of(name: str, known: Iterable[str], key: str) -> str:
    """Return `name` when it is known, or raise `InputError` that names the nearest and all others."""
    names = list(known)
    if name in names:
        return name
    near = difflib.get_close_matches(str(name), names, n=1, cutoff=0.3)
    raise InputError(
        f"unknown {key}",
        key=key,
        value=name,
        expected=f"one of {', '.join(names)}",
        remedy=f"did you mean {near[0]!r}?" if near else None,
    )
