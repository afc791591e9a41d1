"""The wind of staggered grids, brought to where the temperature is."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.heat.reading.lazy import computed

__all__ = ["centred"]


def centred(wind: xr.DataArray, axes: dict[str, xr.DataArray]) -> xr.DataArray:
    """A component of the wind at the places of the temperature, computed when it is read.

    Parameters
    ----------
    wind : xarray.DataArray, m/s
        On faces along one axis, or at the centres already.
    axes : dict of str to xarray.DataArray
        Coordinates of the temperature, m and s.

    Returns
    -------
    xarray.DataArray, m/s

    Notes
    -----
    Linear between the nodes on either side; beyond the first or last node its value.
    """
    for name in [str(axis) for axis in wind.dims if axis in axes]:
        have, want = wind[name].values, axes[name].values
        if name == "time" or np.array_equal(have, want):
            continue
        along = {str(axis): axes[name] if axis == name else wind[axis] for axis in wind.dims}
        number = list(along).index(name)
        moved = computed(_between(have, want, number), [wind], along, whole=[name])
        wind = moved.rename(wind.name).assign_attrs(wind.attrs)
    return wind


def _between(have: NDArray[Any], want: NDArray[Any], number: int) -> Any:
    upper = np.clip(np.searchsorted(have, want), 1 if have.size > 1 else 0, have.size - 1)
    lower = np.maximum(upper - 1, 0)
    span = np.where(upper > lower, have[upper] - have[lower], 1.0)
    weight = np.clip((want - have[lower]) / span, 0.0, 1.0)

    def compute(blocks: list[NDArray[Any]], _: list[NDArray[np.intp]]) -> NDArray[Any]:
        values = np.asarray(blocks[0], dtype=np.float64)
        shape = [-1 if axis == number else 1 for axis in range(values.ndim)]
        low, high = np.take(values, lower, axis=number), np.take(values, upper, axis=number)
        return np.asarray(low + weight.reshape(shape) * (high - low))

    return compute
