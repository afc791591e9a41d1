"""WRF's own output, as a dataset whose axes are metres and whose variables are whole."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.heat.reading.lazy import computed

__all__ = ["from_wrf"]

_NEEDED: Final = ("T", "P", "PB", "PH", "PHB")
_BASE_THETA: Final = 300.0  # K; what T is counted from
_GRAVITY: Final = 9.81  # m s⁻²; WRF's own, which turns geopotential into height
_UNEVEN: Final = 0.02
"""Spread of the heights of a level, relative to that of the top, beyond which the ground is uneven."""


def from_wrf(dataset: xr.Dataset, file: str | None) -> xr.Dataset:
    """Turn output of WRF over level ground into potential temperature, pressure and humidity on x, y, z.

    Parameters
    ----------
    dataset : xarray.Dataset
        Any; it is returned unchanged unless it has WRF's ``T``, ``P``, ``PB``, ``PH``, ``PHB`` on
        ``bottom_top``.
    file : str, optional
        Named in errors.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        The heights of a level differ by more than 2 % of the top: the ground is uneven.

    Notes
    -----
    θ = T + 300 K, p = P + PB, z = (PH + PHB)/g above the lowest face, at the middle of the cell, in the
    horizontal mean at the first instant. x and y count from half a cell, ``DX`` and ``DY`` apart; time is
    ``XTIME`` (minutes). The wind is left where it is and not recognised. Limits: level ground.
    """
    if not all(name in dataset.variables for name in _NEEDED) or "bottom_top" not in dataset["T"].dims:
        return dataset
    z = _heights(dataset, file)
    axes: dict[str, xr.DataArray] = {}
    for dimension in map(str, dataset["T"].dims):
        role = {"bottom_top": "z", "south_north": "y", "west_east": "x", "Time": "time"}.get(dimension)
        if role is None:
            return dataset
        axes[role] = _axis(dataset, dimension, role, z)

    def whole(first: str, second: str | None, offset: float, units: str) -> xr.DataArray:
        sources = [
            dataset[name].rename(dict(zip(dataset["T"].dims, axes, strict=True)))
            for name in (first, second)
            if name
        ]
        sources = [xr.DataArray(source.variable) for source in sources]

        def compute(blocks: list[NDArray[Any]], _: list[NDArray[np.intp]]) -> NDArray[Any]:
            return np.asarray(sum(np.asarray(block, dtype=np.float64) for block in blocks) + offset)

        return computed(compute, sources, axes).assign_attrs(units=units)

    variables = {
        "air_potential_temperature": whole("T", None, _BASE_THETA, "K"),
        "air_pressure": whole("P", "PB", 0.0, "Pa"),
    }
    if "QVAPOR" in dataset:
        variables["humidity_mixing_ratio"] = whole("QVAPOR", None, 0.0, "1")
    return xr.Dataset(variables, attrs=dataset.attrs)


def _heights(dataset: xr.Dataset, file: str | None) -> NDArray[np.float64]:
    first = {"Time": 0} if "Time" in dataset["PH"].dims else {}
    geopotential = dataset["PH"].isel(first) + dataset["PHB"].isel(
        {"Time": 0} if "Time" in dataset["PHB"].dims else {}
    )
    across = [axis for axis in geopotential.dims if axis != "bottom_top_stag"]
    faces = geopotential.astype(np.float64) / _GRAVITY
    faces = faces - faces.isel(bottom_top_stag=0).mean()
    mean = np.asarray(faces.mean(across).values)
    spread = np.asarray((faces.max(across) - faces.min(across)).values)
    uneven = spread > _UNEVEN * max(mean[-1], 1.0)
    if uneven.any():
        level = int(np.argmax(uneven))
        raise InputError(
            f"the heights of level {level} differ by {spread[level]:.1f} m",
            file=file,
            key="PH + PHB",
            expected="level ground",
            remedy="interpolate to fixed heights first",
        )
    return np.asarray(0.5 * (mean[1:] + mean[:-1]))


def _axis(dataset: xr.Dataset, dimension: str, role: str, z: NDArray[np.float64]) -> xr.DataArray:
    count = dataset.sizes[dimension]
    values: NDArray[Any]
    if role == "z":
        values, units = np.asarray(z), "m"
    elif role == "time":
        minutes = dataset["XTIME"].values if "XTIME" in dataset.variables else np.arange(count) * np.nan
        values, units = np.asarray(minutes, dtype=np.float64).reshape(count) * 60.0, "s"
    else:
        step = float(dataset.attrs.get("DX" if role == "x" else "DY", np.nan))
        values, units = (np.arange(count) + 0.5) * step, "m"
    axis = xr.DataArray(values, dims=role, attrs={"units": units})
    return axis.assign_coords({role: axis})
