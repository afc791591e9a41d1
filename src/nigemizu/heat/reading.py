"""Reading air that someone computed or measured: axes and units are recognised, or refused."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.memory import available_memory

__all__ = ["read_air"]

FloatArray: TypeAlias = NDArray[np.float64]

# Per unit: factor and offset to SI.
_KELVIN: Final = {
    **dict.fromkeys(
        ("k", "kelvin", "kelvins", "degk", "deg_k", "degree_kelvin", "degrees_kelvin"), (1.0, 0.0)
    ),
    **dict.fromkeys(
        ("degc", "deg_c", "c", "°c", "celsius", "degree_celsius", "degrees_celsius", "degree_c", "degrees_c"),
        (1.0, 273.15),
    ),
    **dict.fromkeys(("degf", "°f", "fahrenheit", "degree_fahrenheit"), (5.0 / 9.0, 273.15 - 160.0 / 9.0)),
}
_PASCAL: Final = {
    **dict.fromkeys(("pa", "pascal", "pascals"), (1.0, 0.0)),
    **dict.fromkeys(("hpa", "mbar", "millibar", "millibars", "mb", "hectopascal"), (100.0, 0.0)),
    "kpa": (1e3, 0.0),
    "bar": (1e5, 0.0),
    "atm": (101325.0, 0.0),
}
_FRACTION: Final = {
    **dict.fromkeys(("1", "", "fraction", "dimensionless"), (1.0, 0.0)),
    **dict.fromkeys(("%", "percent"), (0.01, 0.0)),
}
_METRE: Final = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), (1.0, 0.0)),
    **dict.fromkeys(("km", "kilometre", "kilometres", "kilometer", "kilometers"), (1e3, 0.0)),
    "cm": (1e-2, 0.0),
    "mm": (1e-3, 0.0),
}
_SECOND: Final = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), (1.0, 0.0)),
    **dict.fromkeys(("ms", "millisecond", "milliseconds"), (1e-3, 0.0)),
    **dict.fromkeys(("min", "mins", "minute", "minutes"), (60.0, 0.0)),
    **dict.fromkeys(("h", "hr", "hrs", "hour", "hours"), (3600.0, 0.0)),
    **dict.fromkeys(("d", "day", "days"), (86400.0, 0.0)),
}
_Units: TypeAlias = dict[str, tuple[float, float]]

# Per variable: its units, the range in which its SI values are believable, and its axes.
_VARIABLES: Final[dict[str, tuple[_Units, float, float]]] = {
    "air_temperature": (_KELVIN, 100.0, 5000.0),
    "surface_temperature": (_KELVIN, 100.0, 5000.0),
    "air_pressure": (_PASCAL, 1.0, 1e7),
    "relative_humidity": (_FRACTION, 0.0, 1.0),
    "air_refractivity": (_FRACTION, 0.0, 0.1),
}
_AXIS_NAMES: Final = {
    "x": ("x", "projection_x_coordinate", "easting"),
    "y": ("y", "projection_y_coordinate", "northing"),
    "z": ("z", "height", "altitude", "height_above_mean_sea_level", "height_above_reference_ellipsoid"),
    "time": ("time", "t"),
}
_COPIES: Final = 4
_DEGREES: Final = ("latitude", "longitude", "lat", "lon", "grid_latitude", "grid_longitude")


def read_air(
    source: str | Path | xr.Dataset, *, available: Callable[[], int | None] = available_memory
) -> xr.Dataset:
    """Read air from a Zarr store or netCDF file, in SI on the axes time, z, y, x.

    Parameters
    ----------
    source : path or xarray.Dataset
        Holds ``air_temperature`` (by name or CF ``standard_name``; K, °C or °F by its ``units``) or else
        ``air_refractivity``, on any of (time, z, y, x), at least z; optionally ``surface_temperature``,
        ``air_pressure`` and ``relative_humidity``. Axes are recognised by the CF attributes ``axis`` and
        ``standard_name`` or by the names x, y, z, height, altitude, time, t.
    available : callable
        Tells the bytes of memory at hand, or None if unknown (then nothing is refused for its size).

    Returns
    -------
    xarray.Dataset
        With those variables only, renamed, converted to SI (K, Pa, 1, m) and transposed to (time, z, y, x);
        axes that the source lacks are absent. Time is in s, from the first instant when the source gives
        dates. Read from a file in SI, the values stay there until they are used.

    Raises
    ------
    InputError
        The file is missing or is no dataset; no such variable (the nearest is named); NaN (where, and
        how many); an axis that does not increase; units of the wrong kind; values that no air has; a single
        instant that does not fit the memory.

    Notes
    -----
    Axes and values without ``units`` are taken as SI. Every value is looked at once, one instant at a time.
    """
    name = None if isinstance(source, xr.Dataset) else str(source)
    dataset = source if isinstance(source, xr.Dataset) else _open(Path(source))
    found = _find_variables(dataset, name)
    renamed: dict[str, xr.DataArray] = {}
    for variable, original in found.items():
        array = _with_axes(dataset[original], name)
        if name is not None:
            _require_memory(array, name, available)
        units, low, high = _VARIABLES[variable]
        array = _converted(array.rename(variable), units, variable, name)
        _check_values(array, variable, low, high, name)
        renamed[variable] = array
    main = "air_temperature" if "air_temperature" in renamed else "air_refractivity"
    if "z" not in renamed[main].dims:
        raise InputError(
            f"{main} has no height axis", file=name, key=main, value=tuple(dataset[found[main]].dims)
        )
    try:
        result = xr.merge(list(renamed.values()), join="exact", compat="equals", combine_attrs="override")
    except (ValueError, xr.MergeError) as error:
        raise InputError(
            "the variables lie on different axes",
            file=name,
            key=", ".join(found.values()),
            expected="the same x, y, z and time for all",
        ) from error
    return result.assign_attrs(dataset.attrs)


def _require_memory(array: xr.DataArray, file: str, available: Callable[[], int | None]) -> None:
    """Refuse an instant that cannot be held: as it is read, in double precision, and as an index."""
    values = array.size // max(array.sizes.get("time", 1), 1)
    need, have = _COPIES * 8 * values, available()
    if have is not None and need > have:
        raise InputError(
            f"one instant of {values:,} values needs {need / 2**30:.2f} GiB of memory, "
            f"and {have / 2**30:.2f} GiB are available",
            file=file,
            key=str(array.name),
            remedy="cut out or coarsen the part that light crosses",
        )


def _open(path: Path) -> xr.Dataset:
    if not path.exists():
        raise InputError("no such file", file=str(path), expected="air in a .zarr store or .nc file")
    engine: Any = "zarr" if path.is_dir() else "netcdf4"
    options: dict[str, Any] = {"consolidated": False} if engine == "zarr" else {}
    try:
        # Times are decoded here, for units of duration and calendars alike.
        return xr.open_dataset(path, engine=engine, decode_times=False, chunks=None, **options)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            "not a dataset that can be read",
            file=str(path),
            expected="a Zarr store or a netCDF file",
            remedy=f"the reader says: {error}",
        ) from error


def _find_variables(dataset: xr.Dataset, file: str | None) -> dict[str, str]:
    """Map our names to the dataset's."""
    found = {}
    for wanted in _VARIABLES:
        if wanted in dataset.data_vars:
            found[wanted] = wanted
            continue
        matches = [
            str(name)
            for name, array in dataset.data_vars.items()
            if array.attrs.get("standard_name") == wanted
        ]
        if len(matches) > 1:
            raise InputError(
                f"several variables have the standard_name {wanted}: {', '.join(matches)}",
                file=file,
                remedy=f"name the right one {wanted}",
            )
        if matches:
            found[wanted] = matches[0]
    if "air_temperature" in found or "air_refractivity" in found:
        return found
    names = [str(name) for name in dataset.data_vars]
    near = difflib.get_close_matches("air_temperature", names, n=1, cutoff=0.4)
    raise InputError(
        "no variable air_temperature",
        file=file,
        expected="air_temperature, or a variable with that standard_name; found "
        + (", ".join(names) if names else "no variable at all"),
        remedy=f"is it {near[0]!r}? rename it or set its standard_name" if near else None,
    )


def _with_axes(array: xr.DataArray, file: str | None) -> xr.DataArray:
    """The array with its axes named, ordered and in SI."""
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
    array = array.drop_vars([str(name) for name in array.coords if str(name) not in roles])
    converted = {role: _axis(array[name], role, file) for name, role in roles.items()}
    array = array.rename(roles).assign_coords(converted)
    return array.transpose(*[role for role in ("time", "z", "y", "x") if role in roles.values()])


def _role(array: xr.DataArray, dimension: str) -> str | None:
    attributes = array[dimension].attrs if dimension in array.coords else {}
    described = str(attributes.get("standard_name", "")).lower()
    if _in_degrees(array, dimension):
        return None
    axis = {"x": "x", "y": "y", "z": "z", "t": "time"}.get(str(attributes.get("axis", "")).lower())
    if axis is not None:
        return axis
    for role, names in _AXIS_NAMES.items():
        if described in names or dimension.lower() in names:
            return role
    return None


def _in_degrees(array: xr.DataArray, dimension: Hashable) -> bool:
    attributes = array[dimension].attrs if dimension in array.coords else {}
    names = (str(attributes.get("standard_name", "")).lower(), str(dimension).lower())
    return any(name in _DEGREES for name in names)


def _axis(coordinate: xr.DataArray, role: str, file: str | None) -> xr.DataArray:
    """The coordinate in m, or in s; increasing, finite."""
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
        factor, _ = _unit(units, _METRE, "lengths (m, km, cm, mm)", name, file)
        seconds = _numbers(values, name, file) * factor
    if not np.isfinite(seconds).all():
        index = int(np.argmin(np.isfinite(seconds)))
        raise InputError(f"the axis is not finite at index {index}", file=file, key=name)
    falling = np.diff(seconds) <= 0.0
    if falling.any():
        index = int(np.argmax(falling)) + 1
        raise InputError(
            f"the axis does not increase at index {index}",
            file=file,
            key=name,
            value=[float(seconds[index - 1]), float(seconds[index])],
            expected="strictly increasing values",
            remedy=f"sort it: dataset.sortby({name!r})" if np.unique(seconds).size == seconds.size else None,
        )
    kept = {
        key: value for key, value in coordinate.attrs.items() if key not in ("units", "calendar", "bounds")
    }
    return xr.DataArray(seconds, dims=role, attrs={**kept, "units": "s" if role == "time" else "m"})


def _seconds(values: NDArray[Any], units: str, name: str, file: str | None) -> FloatArray:
    if np.issubdtype(values.dtype, np.datetime64) or np.issubdtype(values.dtype, np.timedelta64):
        if np.isnat(values).any():
            raise InputError(
                f"the axis has no date at index {int(np.argmax(np.isnat(values)))}", file=file, key=name
            )
        origin = values[0] if np.issubdtype(values.dtype, np.datetime64) else np.timedelta64(0, "s")
        return np.asarray((values - origin) / np.timedelta64(1, "s"), dtype=np.float64)
    unit, since, _ = units.partition(" since ")
    factor, _ = _unit(unit.strip(), _SECOND, "durations (s, min, h, days), or dates", name, file)
    numbers = _numbers(values, name, file)
    return (numbers - numbers[0] if since else numbers) * factor


def _numbers(values: NDArray[Any], name: str, file: str | None) -> FloatArray:
    if not np.issubdtype(values.dtype, np.number) or np.issubdtype(values.dtype, np.complexfloating):
        raise InputError("not numbers", file=file, key=name, value=str(values.dtype))
    return np.asarray(values, dtype=np.float64)


def _unit(units: str, known: _Units, kind: str, name: str, file: str | None) -> tuple[float, float]:
    if not units:
        return 1.0, 0.0
    if units.lower() not in known:
        raise InputError("units of the wrong kind", file=file, key=name, value=units, expected=kind)
    return known[units.lower()]


def _converted(array: xr.DataArray, known: _Units, variable: str, file: str | None) -> xr.DataArray:
    units = str(array.attrs.get("units", "")).strip()
    kind = {id(_KELVIN): "a temperature (K, degC)", id(_PASCAL): "a pressure (Pa, hPa)"}.get(
        id(known), "1 or %"
    )
    factor, offset = _unit(units, known, kind, variable, file)
    si = {id(_KELVIN): "K", id(_PASCAL): "Pa"}.get(id(known), "1")
    if (factor, offset) == (1.0, 0.0):
        return array.assign_attrs(units=si)  # stays in its file until it is used
    return (array.astype(np.float64) * factor + offset).assign_attrs({**array.attrs, "units": si})


def _check_values(array: xr.DataArray, variable: str, low: float, high: float, file: str | None) -> None:
    """Refuse NaN, infinity and values that no air has, reading one instant at a time."""
    _numbers(np.empty(0, array.dtype), variable, file)
    instants = range(array.sizes["time"]) if "time" in array.dims else [None]
    missing, first = 0, None
    for index in instants:
        values = (array if index is None else array.isel(time=index)).values
        if not values.size:
            raise InputError("there are no values", file=file, key=variable)
        smallest, largest = float(values.min()), float(values.max())  # NaN if any is
        if np.isfinite(smallest) and np.isfinite(largest):
            _check_range(smallest, largest, variable, low, high, file)
            continue
        bad = ~np.isfinite(values)
        missing += int(bad.sum())
        if first is None:
            place = np.argwhere(bad)[0].tolist() if bad.ndim else []
            full = place if index is None else [index, *place]
            first = ", ".join(f"{axis} {number}" for axis, number in zip(array.dims, full, strict=True))
    if missing:
        raise InputError(
            f"{missing} of {array.size} values are NaN or infinite, the first at index {first}",
            file=file,
            key=variable,
            expected="finite values everywhere",
            remedy="fill the gaps, or cut them off",
        )


def _check_range(
    smallest: float, largest: float, variable: str, low: float, high: float, file: str | None
) -> None:
    if smallest < low or largest > high:
        raise InputError(
            "values that no air has",
            file=file,
            key=variable,
            value=smallest if smallest < low else largest,
            expected=f"{low:g} to {high:g} in SI units",
            remedy="check the units attribute",
        )
