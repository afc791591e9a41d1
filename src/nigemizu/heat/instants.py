"""The instants of a labelled dataset of air, and its values on the axes z, y, x."""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.air import Atmosphere
from nigemizu.errors import InputError
from nigemizu.heat.reading import with_temperature

__all__ = ["Index", "at_instant", "bracket", "has_temperature", "instants", "shaped"]

FloatArray: TypeAlias = NDArray[np.float64]

Index: TypeAlias = tuple[int, ...]
"""Along time; the empty one for air that does not change."""

_TEMPERATURES: Final = ("air_temperature", "air_potential_temperature", "surface_temperature", "air_pressure")
_OPTICS: Final = ("relative_humidity", "specific_humidity")


def has_temperature(dataset: xr.Dataset) -> bool:
    """Whether the dataset tells the temperature, if need be once the pressure is known."""
    return "air_temperature" in dataset or "air_potential_temperature" in dataset


def instants(dataset: xr.Dataset) -> list[Index]:
    """Indices along time; the empty one for air that does not change."""
    return [(index,) for index in range(dataset.sizes["time"])] if "time" in dataset.dims else [()]


def at_instant(
    dataset: xr.Dataset, index: Index, atmosphere: Atmosphere, *, optics: bool = True
) -> xr.Dataset:
    """One instant in memory, with its temperature and relative humidity, be they stored or follow from it.

    Without `optics` only the temperatures. Each variable is read once, and no other instant.
    """
    wanted: tuple[str, ...] = (*_TEMPERATURES, *_OPTICS) if optics else _TEMPERATURES
    if not has_temperature(dataset):
        wanted = ("air_refractivity",)
    present = dataset[[name for name in wanted if name in dataset]]
    instant = (present.isel(time=index[0]) if index else present.copy(deep=False)).load()
    order = [axis for axis in ("z", "y", "x") if axis in instant.dims]
    return with_temperature(instant, atmosphere).transpose(*order, ...)


def shaped(variable: xr.DataArray) -> FloatArray:
    """Values on (z, y, x), with length 1 along the axes that the variable lacks."""
    axes = ("z", "y", "x")
    missing = [axis for axis in axes if axis not in variable.dims]
    full = variable.expand_dims(missing).transpose(*axes)
    return np.asarray(full.values, dtype=np.float64)


def bracket(dataset: xr.Dataset, time: float) -> tuple[Index, Index, float]:
    """Indices of the stored instants around `time` and the weight of the later one."""
    if "time" not in dataset.dims:
        return (), (), 0.0
    times = np.asarray(dataset["time"].values, dtype=np.float64)
    first, last = float(times[0]), float(times[-1])
    if not first <= time <= last:
        raise InputError(
            "the air is not known at this time",
            key="time",
            value=float(time),
            expected=f"from {first:g} s to {last:g} s"
            if times.size > 1
            else f"{first:g} s, its only instant",
        )
    upper = int(np.searchsorted(times, time))
    if times[upper] == time:
        return (upper,), (upper,), 0.0
    weight = (time - times[upper - 1]) / (times[upper] - times[upper - 1])
    return (upper - 1,), (upper,), float(weight)
