"""The axes of other people's air: which is which, in m and s, increasing."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.heat.reading.crop import cut
from nigemizu.heat.reading.units import METRE, SECOND

__all__ = ["ORDER", "Placed", "numbers", "placed"]

FloatArray: TypeAlias = NDArray[np.float64]

ORDER: Final = ("time", "z", "y", "x")
"""Order of the axes of every volume."""

_NAMES: Final = {
    "x": ("x", "xu", "xh", "xt", "xm", "xf", "xc", "projection_x_coordinate", "easting"),
    "y": ("y", "yv", "yh", "yt", "ym", "yf", "yc", "projection_y_coordinate", "northing"),
    "z": (
        *("z", "zu_3d", "zw_3d", "zu", "zw", "zh", "zt", "zm", "zf", "zc"),
        *("height", "altitude", "height_above_mean_sea_level", "height_above_reference_ellipsoid"),
    ),
    "time": ("time", "t"),
}
_BELOW_GROUND: Final = ("zu_3d", "zu")
"""Axes whose first level may mirror the air into the ground, half a cell below height 0."""
_DEGREES: Final = ("latitude", "longitude", "lat", "lon", "grid_latitude", "grid_longitude")


class Placed(NamedTuple):
    """A variable on known axes; none of its values has been read.

    Attributes
    ----------
    array : xarray.DataArray
        Dimensions named time, z, y, x, in the order of the file.
    axes : dict of str to xarray.DataArray
        Coordinates in m and s, increasing, in the order time, z, y, x.
    """

    array: xr.DataArray
    axes: dict[str, xr.DataArray]


def placed(array: xr.DataArray, box: dict[str, tuple[float, float]], file: str | None) -> Placed:
    """Name the axes, turn them upwards and cut out the box.

    Parameters
    ----------
    array : xarray.DataArray
        As it stands in the file.
    box : dict of str to (float, float)
        Ranges of x, y, z (m) and time (s) to be kept, ends included.
    file : str, optional
        Named in errors.

    Raises
    ------
    InputError
        An axis that is unknown, doubled, without values, unordered or in wrong units; an empty box.
    """
    array, roles = _roles(array, file)
    axes, parts = {}, {}
    for name, role in roles.items():
        coordinate, falls = _axis(array[name], role, file)
        if falls:
            array = array.isel({name: slice(None, None, -1)})
        low, high = box.get(role, (-np.inf, np.inf))
        if role == "z" and name in _BELOW_GROUND:
            low = max(low, 0.0)
        if (low, high) != (-np.inf, np.inf):
            parts[name] = cut(coordinate, low, high, file)
            coordinate = coordinate.isel({role: parts[name]})
        axes[role] = coordinate
    array = array.isel(parts).drop_vars(list(array.coords)).rename(roles)
    return Placed(array, {role: axes[role] for role in ORDER if role in axes})


def _roles(array: xr.DataArray, file: str | None) -> tuple[xr.DataArray, dict[str, str]]:
    roles: dict[str, str] = {}
    for dimension in array.dims:
        role = _role(array, str(dimension))
        if role is None and array.sizes[dimension] == 1:
            array = array.squeeze(dimension, drop=True)
            continue
        if role is None or role in roles.values():
            raise InputError(
                "cannot tell what this axis is" if role is None else f"two axes are {role}",
                file=file,
                key=str(dimension),
                expected="x, y, z (height, altitude), time as its name, axis or standard_name",
                remedy="project latitude and longitude to metres" if _in_degrees(array, dimension) else None,
            )
        if dimension not in array.coords:
            raise InputError("this axis has no coordinate values", file=file, key=str(dimension))
        roles[str(dimension)] = role
    return array, roles


def _role(array: xr.DataArray, dimension: str) -> str | None:
    attributes = array[dimension].attrs if dimension in array.coords else {}
    described = str(attributes.get("standard_name", "")).lower()
    if _in_degrees(array, dimension):
        return None
    axis = {"x": "x", "y": "y", "z": "z", "t": "time"}.get(str(attributes.get("axis", "")).lower())
    if axis is not None:
        return axis
    for role, names in _NAMES.items():
        if described in names or dimension.lower() in names:
            return role
    return "z" if str(attributes.get("positive", "")).lower() in ("up", "down") else None


def _in_degrees(array: xr.DataArray, dimension: Hashable) -> bool:
    attributes = array[dimension].attrs if dimension in array.coords else {}
    names = (str(attributes.get("standard_name", "")).lower(), str(dimension).lower())
    return any(name in _DEGREES for name in names)


def _axis(coordinate: xr.DataArray, role: str, file: str | None) -> tuple[xr.DataArray, bool]:
    """The coordinate in m, or in s, increasing and finite; and whether the file has it falling."""
    name = str(coordinate.name)
    units = str(coordinate.attrs.get("units", "")).strip()
    values = coordinate.values
    if role == "time":
        seconds = _seconds(values, units, name, file)
    elif str(coordinate.attrs.get("positive", "up")).lower() == "down":
        raise InputError(
            "the vertical axis points down", file=file, key=name, expected="heights, positive up"
        )
    else:
        factor, _ = METRE.to_si(units, name, file)
        seconds = numbers(values, name, file) * factor
    if not np.isfinite(seconds).all():
        index = int(np.argmin(np.isfinite(seconds)))
        raise InputError(f"the axis is not finite at index {index}", file=file, key=name)
    falls = seconds.size > 1 and bool((np.diff(seconds) < 0.0).all())
    seconds = seconds[::-1] if falls else seconds
    wrong = np.diff(seconds) <= 0.0
    if wrong.any():
        index = int(np.argmax(wrong)) + 1
        raise InputError(
            f"the axis does not increase at index {index}",
            file=file,
            key=name,
            value=[float(seconds[index - 1]), float(seconds[index])],
            expected="strictly increasing values",
            remedy=f"sort it: dataset.sortby({name!r})" if np.unique(seconds).size == seconds.size else None,
        )
    dropped = ("units", "calendar", "bounds")
    kept = {key: value for key, value in coordinate.attrs.items() if key not in dropped}
    axis = xr.DataArray(seconds, dims=role, attrs={**kept, "units": "s" if role == "time" else "m"})
    return axis.assign_coords({role: axis}), falls


def _seconds(values: NDArray[Any], units: str, name: str, file: str | None) -> FloatArray:
    if np.issubdtype(values.dtype, np.datetime64) or np.issubdtype(values.dtype, np.timedelta64):
        if np.isnat(values).any():
            raise InputError(
                f"the axis has no date at index {int(np.argmax(np.isnat(values)))}", file=file, key=name
            )
        origin = values.min() if np.issubdtype(values.dtype, np.datetime64) else np.timedelta64(0, "s")
        return np.asarray((values - origin) / np.timedelta64(1, "s"), dtype=np.float64)
    unit, since, _ = units.partition(" since ")
    factor, _ = SECOND.to_si(unit, name, file)
    stamps = numbers(values, name, file)
    return (stamps - stamps.min() if since and stamps.size else stamps) * factor


def numbers(values: NDArray[Any], name: str, file: str | None) -> FloatArray:
    """The values in double precision.

    Raises
    ------
    InputError
        They are not real numbers.
    """
    if not np.issubdtype(values.dtype, np.number) or np.issubdtype(values.dtype, np.complexfloating):
        raise InputError("not numbers", file=file, key=name, value=str(values.dtype))
    return np.asarray(values, dtype=np.float64)
