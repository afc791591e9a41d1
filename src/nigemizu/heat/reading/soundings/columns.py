"""A column out of a model: ERA5 and other CF data on pressure levels or on heights, in netCDF or Zarr."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.heat.reading.names import LOOKED_FOR, described
from nigemizu.heat.reading.opening import open_dataset
from nigemizu.heat.reading.soundings.choosing import Wanted
from nigemizu.heat.reading.soundings.levels import Levels
from nigemizu.heat.reading.units import METRE, PASCAL, Units

__all__ = ["read_column"]

FloatArray: TypeAlias = NDArray[np.float64]

_SHORT: Final = {
    "air_temperature": ("t",),
    "specific_humidity": (),
    "relative_humidity": ("r",),
    "x_wind": (),
    "y_wind": (),
}
"""What ERA5 calls things besides what `LOOKED_FOR` knows."""
_OURS: Final = {"air_temperature": "temperature"}
_GEOPOTENTIAL: Final = Units(
    "m2 s-2", "m2 s-2", dict.fromkeys(("m2 s-2", "m^2 s^-2", "m2/s2", "m2.s-2"), (1.0 / 9.80665, 0.0))
)
_PRESSURE_AXES: Final = ("pressure_level", "isobaricinhpa", "isobaric", "plev", "level", "lev", "pressure")
_HEIGHT_AXES: Final = ("height", "altitude", "z")
_TIMES: Final = ("valid_time", "time")
_GROUND: Final = ("sp", "ps", "surface_pressure", "surface_air_pressure")
_ALONE: Final = 1.0
"""Degrees around a single point of a grid."""


def read_column(path: Path, want: Wanted) -> Levels:
    """The column of a model nearest to a place, at one time.

    Parameters
    ----------
    path : pathlib.Path
    want : Wanted
        Place and time; either may be missing where the file has only one.

    Returns
    -------
    Levels

    Raises
    ------
    InputError
        No temperature; no pressure levels or heights; several times or places and none is wanted; a time that
        is not there; a place outside the grid.

    Notes
    -----
    Heights are the geopotential (m² s⁻²) over 9.80665, the geopotential height, or the vertical axis; without
    any, they follow from the weight of the air. Specific humidity is preferred to relative humidity, which
    models count over ice where it is cold. Levels of higher pressure than that at the ground, if the file has
    it, are left out; otherwise those that the model continues into the ground stay. Limits: axes of latitude
    and longitude; no levels of hybrid coordinates.
    """
    file = str(path)
    dataset = open_dataset(path)
    names = {ours: _variable(dataset, ours, short) for ours, short in _SHORT.items()}
    if names["air_temperature"] is None:
        raise InputError(
            "no temperature of the air",
            file=file,
            expected="air_temperature (t, ta, T) in K; found " + described(dataset),
        )
    picks, time, place = _point(dataset[names["air_temperature"]], dataset, want, file)
    column = dataset[names["air_temperature"]].isel(picks)
    vertical = [str(name) for name in column.dims if column.sizes[name] > 1]
    if len(vertical) != 1:
        raise InputError(
            "no vertical axis" if not vertical else f"axes that are not known: {', '.join(vertical)}",
            file=file,
            key=names["air_temperature"],
            expected="a temperature on time, levels, latitude and longitude",
            remedy="select one of them first, as ds.isel(number=0)" if vertical else None,
        )
    values, zero = _levels_of(dataset, column, vertical[0], picks, file)
    for ours, theirs in names.items():
        if theirs is not None:
            values[_OURS.get(ours, ours)] = _values(
                dataset, theirs, LOOKED_FOR[ours].units, picks, vertical[0], file
            )
    if np.isfinite(values.get("specific_humidity", np.nan)).any():
        values.pop("relative_humidity", None)
    values.update(_wind(values.pop("x_wind", None), values.pop("y_wind", None)))
    levels = Levels(
        [f"level {text}" for text in _texts(dataset, vertical[0], column.sizes[vertical[0]])],
        values,
        geopotential=zero == "geopotential",
        from_ground=zero == "ground",
        time=time,
        place=place,
        source=f"{file} (column of a model)",
    )
    return _above_ground(_falling(levels), dataset, picks, file)


def _variable(dataset: xr.Dataset, ours: str, short: Sequence[str]) -> str | None:
    kind = LOOKED_FOR[ours]
    for standard in (ours, *kind.standard_names):
        for name, array in dataset.data_vars.items():
            if name == standard or array.attrs.get("standard_name") == standard:
                return str(name)
    for alias in (*kind.aliases, *short):
        if alias in dataset.data_vars and _spelt(dataset[alias]) in ("", *kind.units.known):
            return alias
    return None


def _spelt(array: xr.DataArray) -> str:
    """The units, with exponents as the reading room spells them."""
    return str(array.attrs.get("units", "")).replace("**", "^").strip().lower()


def _values(
    dataset: xr.Dataset, name: str, units: Units, picks: dict[str, int], vertical: str | None, file: str
) -> FloatArray:
    array = dataset[name].isel({axis: at for axis, at in picks.items() if axis in dataset[name].dims})
    left = [axis for axis in array.dims if axis != vertical and array.sizes[axis] > 1]
    if left:
        raise InputError("an axis that the temperature lacks", file=file, key=f"{name}: {left[0]}")
    factor, offset = units.to_si(_spelt(array), name, file)
    values = np.asarray(array.values, dtype=np.float64).reshape(-1) * factor + offset
    return np.where(np.isfinite(values), values, np.nan)


def _point(
    array: xr.DataArray, dataset: xr.Dataset, want: Wanted, file: str
) -> tuple[dict[str, int], datetime | None, tuple[float, float] | None]:
    """Indices of the time and of the place along their axes, and what they are."""
    picks: dict[str, int] = {}
    time: datetime | None = want.time
    name = next((name for name in _TIMES if name in array.coords or name in dataset.coords), None)
    if name is not None:
        stamps = _times(dataset[name], file)
        index = _time_index(stamps, want, file)
        time = stamps[index]
        if name in array.dims:
            picks[name] = index
        elif dataset[name].dims and dataset[name].dims[0] in array.dims:
            picks[str(dataset[name].dims[0])] = index
    found = []
    for axis, spellings in (("latitude", ("latitude", "lat")), ("longitude", ("longitude", "lon"))):
        coordinate = next((array[name] for name in spellings if name in array.coords), None)
        if coordinate is None:
            continue
        if coordinate.ndim > 1:
            raise InputError(
                f"{axis} is no axis of this grid", file=file, key=str(coordinate.name),
                remedy="interpolate to latitudes and longitudes first (cdo remapbil)",
            )  # fmt: skip
        along = np.asarray(coordinate.values, dtype=np.float64).reshape(-1)
        index = _nearest(along, axis, want, file)
        found.append(float(along[index]))
        if coordinate.dims:
            picks[str(coordinate.dims[0])] = index
    place = want.place if len(found) < 2 else (found[0], (found[1] + 180.0) % 360.0 - 180.0)
    return picks, time, place


def _times(coordinate: xr.DataArray, file: str) -> list[datetime]:
    try:
        decoded = xr.decode_cf(
            xr.Dataset(coords={"time": ("time", np.atleast_1d(coordinate.values), coordinate.attrs)})
        )
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(
            "no times that can be read", file=file, key=str(coordinate.name), value=str(error)
        ) from error
    values = decoded["time"].values
    if not np.issubdtype(values.dtype, np.datetime64):
        raise InputError(
            "no dates",
            file=file,
            key=str(coordinate.name),
            value=coordinate.attrs.get("units"),
            expected="units such as 'hours since 1900-01-01', in the calendar of all days",
        )
    return [stamp.replace(tzinfo=UTC) for stamp in values.astype("M8[s]").tolist()]


def _time_index(stamps: list[datetime], want: Wanted, file: str) -> int:
    there = f"{len(stamps)} from {stamps[0]:%Y-%m-%d %H:%M} to {stamps[-1]:%Y-%m-%d %H:%M}"
    if want.time is None:
        if len(stamps) == 1:
            return 0
        raise InputError("several times", file=file, key="time", expected=f"one of {there}")
    fitting = [
        index
        for index, stamp in enumerate(stamps)
        if stamp == want.time or (want.whole_day and stamp.date() == want.time.date())
    ]
    if len(fitting) != 1:
        sought = want.time
        near = sorted(stamps, key=lambda stamp: abs(stamp - sought))[:3]
        raise InputError(
            "no such time" if not fitting else f"{len(fitting)} times on that day",
            file=file,
            key="time",
            value=f"{want.time:%Y-%m-%d %H:%M}",
            expected=f"one of {there}, as " + ", ".join(f"{stamp:%Y-%m-%d %H:%M}" for stamp in sorted(near)),
        )
    return fitting[0]


def _nearest(along: FloatArray, axis: str, want: Wanted, file: str) -> int:
    """Index of the node nearest to the place that is wanted, which lies within half a cell of it."""
    there = f"{along.min():g} to {along.max():g}"
    if want.place is None:
        if along.size == 1:
            return 0
        raise InputError(
            f"{along.size} places along the {axis}", file=file, key="place", expected=f"{axis} {there}"
        )
    sought = want.place[0 if axis == "latitude" else 1]
    away = np.abs(along - sought) if axis == "latitude" else np.abs((along - sought + 180.0) % 360.0 - 180.0)
    index = int(np.argmin(away))
    reach = _ALONE if along.size == 1 else 0.5 * float(np.abs(np.diff(along)).max()) * (1.0 + 1e-6)
    if away[index] > reach:
        raise InputError(
            f"the place lies {away[index]:g} degrees of {axis} outside the grid",
            file=file,
            key="place",
            value=want.place,
            expected=f"{axis} {there}",
        )
    return index


def _levels_of(
    dataset: xr.Dataset, column: xr.DataArray, vertical: str, picks: dict[str, int], file: str
) -> tuple[dict[str, FloatArray], str]:
    """Pressure and height of the levels, as far as the file has them, and where the heights count from."""
    values: dict[str, FloatArray] = {}
    axis = dataset[vertical] if vertical in dataset.coords else None
    spelling = "" if axis is None else _spelt(axis)
    called = {vertical.lower(), "" if axis is None else str(axis.attrs.get("standard_name", "")).lower()}
    zero = "geopotential"
    if axis is not None and (
        spelling in PASCAL.known or (called & {*_PRESSURE_AXES, "air_pressure"} and not spelling)
    ):
        # Without units, numbers of a pressure axis below 2000 are hPa: no level of a model is in that vacuum.
        unit = spelling or ("hpa" if float(axis.max()) < 2000.0 else "pa")
        factor, _ = PASCAL.to_si(unit, vertical, file)
        values["pressure"] = np.asarray(axis.values, dtype=np.float64) * factor
    elif axis is not None and called & set(_HEIGHT_AXES):
        factor, _ = METRE.to_si(spelling, vertical, file)
        values["height"] = np.asarray(axis.values, dtype=np.float64) * factor
        zero = "sea" if "altitude" in called else "ground"
    pressure = _variable(dataset, "air_pressure", ("p",))
    if "pressure" not in values and pressure is not None:
        values["pressure"] = _values(dataset, pressure, PASCAL, picks, vertical, file)
    if "height" not in values:
        values.update(_geopotential(dataset, vertical, picks, file))
    if "pressure" not in values:
        raise InputError(
            "no pressure of the levels",
            file=file,
            key=vertical,
            value=spelling or None,
            expected="an axis in Pa or hPa, or a variable air_pressure; found " + described(dataset),
            remedy="bring levels of hybrid coordinates to pressure levels first (cdo ml2pl)",
        )
    return values, zero


def _geopotential(
    dataset: xr.Dataset, vertical: str, picks: dict[str, int], file: str
) -> dict[str, FloatArray]:
    for name, array in dataset.data_vars.items():
        if vertical not in array.dims:
            continue
        standard, spelling = str(array.attrs.get("standard_name", "")), _spelt(array)
        if spelling in _GEOPOTENTIAL.known and (
            standard == "geopotential" or name in ("z", "phi", "geopotential")
        ):
            return {"height": _values(dataset, str(name), _GEOPOTENTIAL, picks, vertical, file)}
        if standard == "geopotential_height" or name in ("zg", "gh", "hgt", "geopotential_height"):
            return {"height": _values(dataset, str(name), METRE, picks, vertical, file)}
    return {}


def _wind(x: FloatArray | None, y: FloatArray | None) -> dict[str, FloatArray]:
    if x is None or y is None:
        return {}
    return {"wind_speed": np.hypot(x, y), "wind_direction": np.degrees(np.arctan2(-x, -y)) % 360.0}


def _texts(dataset: xr.Dataset, vertical: str, count: int) -> list[str]:
    if vertical not in dataset.coords:
        return [str(number) for number in range(1, count + 1)]
    units = str(dataset[vertical].attrs.get("units", ""))
    return [f"{float(value):g} {units}".strip() for value in dataset[vertical].values]


def _falling(levels: Levels) -> Levels:
    """From the highest pressure upwards: models do not always sort their levels."""
    order = np.argsort(-levels.values["pressure"], kind="stable")
    return levels.taken(order, levels.notes)


def _above_ground(levels: Levels, dataset: xr.Dataset, picks: dict[str, int], file: str) -> Levels:
    name = next(
        (
            str(name)
            for name, array in dataset.data_vars.items()
            if name in _GROUND or array.attrs.get("standard_name") == "surface_air_pressure"
        ),
        None,
    )
    if name is None:
        return levels
    ground = float(_values(dataset, name, PASCAL, picks, None, file)[0])
    return levels.kept(levels.values["pressure"] <= ground, "left out below the ground")
