"""Values at the door: fill values below the ground, units, and what no air has."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.heat.reading.axes import Placed, numbers
from nigemizu.heat.reading.lazy import computed
from nigemizu.heat.reading.names import LOOKED_FOR
from nigemizu.heat.reading.units import KELVIN

__all__ = ["bring_home"]

_FILLS: Final = (-999999.0, -99999.0, -9999.0, 9.969209968386869e36)
"""Of PALM, of others, and of netCDF itself, where the file does not declare what it fills with."""
_LOOKED_AT: Final = 2**22
"""Values up to which everything in a file is looked at when it is opened."""


class _Door(NamedTuple):
    """How the values of one variable become ours."""

    variable: str
    factor: float
    offset: float
    zero_is_missing: bool
    dtype: np.dtype[Any]
    file: str | None
    axes: tuple[str, ...]

    def home(self, blocks: list[NDArray[Any]], places: list[NDArray[np.intp]]) -> NDArray[Any]:
        """The values of a block, or the reason why they cannot be used."""
        values, bad = self.look(blocks[0])
        if bad is not None:
            raise self.refusal(int(bad.sum()), bad.size, self.first(bad, places))
        return values

    def look(self, raw: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
        """The values, and where there are none, if so anywhere."""
        if not raw.size:
            raise InputError("there are no values", file=self.file, key=self.variable)
        if raw.dtype.kind != "f" or raw.dtype.itemsize < 4:
            raw = raw.astype(np.float64)  # whole numbers and halves have no room for what files fill with
        values, bad = raw, None
        if not self._plain(raw):
            values, bad = self._filled(raw)
            if bad.any():
                return values, bad
        values = values.astype(self.dtype, copy=False)
        if (self.factor, self.offset) != (1.0, 0.0):
            values = values * self.factor + self.offset
        self._require_believable(values)
        return values, None

    def _plain(self, raw: NDArray[Any]) -> bool:
        """Whether there is nothing to fill, which the extremes alone tell."""
        smallest, largest = float(raw.min()), float(raw.max())  # NaN if any is
        suspect = self.zero_is_missing and smallest <= 0.0
        return bool(np.isfinite(smallest) and np.isfinite(largest)) and not (
            suspect or smallest <= max(_FILLS[:3]) or largest >= 1e30
        )

    def _filled(self, raw: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Missing values below the lowest one of a column become that one; the others are told."""
        missing = np.isnan(raw) | np.isin(raw, np.array(_FILLS, dtype=raw.dtype))
        if self.zero_is_missing:
            missing |= raw == 0.0
        bad = missing | ~np.isfinite(raw)
        if "z" not in self.axes or not missing.any():
            return raw, bad
        axis = self.axes.index("z")
        lowest = np.expand_dims(np.argmin(bad, axis=axis), axis)
        level = np.arange(raw.shape[axis]).reshape([-1 if n == axis else 1 for n in range(raw.ndim)])
        below = (level < lowest) & np.logical_and.accumulate(missing, axis=axis)
        return np.where(below, np.take_along_axis(raw, lowest, axis), raw), bad & ~below

    def _require_believable(self, values: NDArray[Any]) -> None:
        kind = LOOKED_FOR[self.variable]
        smallest, largest = float(values.min()), float(values.max())
        if smallest < kind.low or largest > kind.high:
            raise InputError(
                "values that no air has",
                file=self.file,
                key=self.variable,
                value=smallest if smallest < kind.low else largest,
                expected=f"{kind.low:g} to {kind.high:g} in SI units",
                remedy="check the units attribute",
            )

    def first(self, bad: NDArray[np.bool_], places: list[NDArray[np.intp]]) -> str:
        """Where the first value that cannot be used stands."""
        place = np.argwhere(bad)[0]
        indices = [int(along[number]) for along, number in zip(places, place, strict=True)]
        return ", ".join(f"{axis} {index}" for axis, index in zip(self.axes, indices, strict=True))

    def refusal(self, count: int, size: int, first: str) -> InputError:
        """What is said of values that are missing."""
        return InputError(
            f"{count} of {size} values are NaN or infinite, the first at index {first}"
            if first
            else "the value is NaN or infinite",
            file=self.file,
            key=self.variable,
            expected="finite values everywhere, but for the lowest of a column (below the ground)",
            remedy="fill the gaps, or cut them off",
        )


def bring_home(placed: Placed, variable: str, file: str | None) -> xr.DataArray:
    """One variable in SI, without gaps; its values stay where they are until they are used.

    Parameters
    ----------
    placed : Placed
    variable : str
        Our name for it, a key of `names.LOOKED_FOR`.
    file : str, optional
        Named in errors.

    Returns
    -------
    xarray.DataArray

    Raises
    ------
    InputError
        Not numbers; units of another kind; and, for whatever is looked at, values that are missing above the
        ground or that no air has. What is not looked at here is when it is used.

    Notes
    -----
    Up to 4 million values everything is looked at, one instant at a time; of more, the first instant.
    Missing are NaN, the file's own fill values, −999999, −99999, −9999, netCDF's default and, where the file
    gives kelvin, 0. The missing values at the bottom of a column are below the ground and become the lowest
    value above it.
    """
    array, axes = placed
    numbers(np.empty(0, array.dtype), variable, file)
    units = str(array.attrs.get("units", ""))
    kind = LOOKED_FOR[variable]
    factor, offset = kind.units.to_si(units, variable, file)
    same = (factor, offset) == (1.0, 0.0) and array.dtype.kind == "f"
    dtype = array.dtype.newbyteorder("=") if same else np.dtype(np.float64)
    kelvin = kind.units is KELVIN and offset == 0.0
    door = _Door(variable, factor, offset, kelvin, dtype, file, tuple(axes))
    if not array.size:
        raise InputError("there are no values", file=file, key=variable)
    _look_through(array, axes, door, everything=array.size <= _LOOKED_AT or file is None)
    home = computed(door.home, [array], axes, dtype=dtype, whole=["z"] if "z" in axes else [])
    attributes = {
        name: value for name, value in array.attrs.items() if name not in ("missing_value", "_FillValue")
    }
    return home.rename(variable).assign_attrs({**attributes, "units": kind.units.si})


def _look_through(
    array: xr.DataArray, axes: dict[str, xr.DataArray], door: _Door, *, everything: bool
) -> None:
    count = axes["time"].size if "time" in axes and everything else 1
    missing, first = 0, ""
    for index in range(count):
        part = array.isel(time=slice(index, index + 1)) if "time" in axes else array
        raw = np.asarray(part.variable.values).transpose([part.dims.index(axis) for axis in axes])
        bad = door.look(raw)[1]
        if bad is None:
            continue
        places = [
            np.arange(size) + (index if axis == "time" else 0)
            for axis, size in zip(axes, bad.shape, strict=True)
        ]
        first = first or door.first(bad, places)
        missing += int(bad.sum())
    if missing:
        raise door.refusal(missing, array.size if everything else _instant(array), first)


def _instant(array: xr.DataArray) -> int:
    """How many values an instant has."""
    return array.size // max(array.sizes.get("time", 1), 1)
