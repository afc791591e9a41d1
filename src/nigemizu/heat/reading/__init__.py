"""Reading air that someone computed or measured: names, axes and units are recognised, or refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.heat.reading.axes import Placed, placed
from nigemizu.heat.reading.crop import Crop, checked_crop, split_crop
from nigemizu.heat.reading.lazy import computed
from nigemizu.heat.reading.names import find_variables
from nigemizu.heat.reading.opening import open_dataset
from nigemizu.heat.reading.potential import absolute, reference_pressure, with_temperature
from nigemizu.heat.reading.values import bring_home
from nigemizu.heat.reading.wind import centred
from nigemizu.heat.reading.wrf import from_wrf
from nigemizu.memory import available_memory

__all__ = ["absolute", "read_air", "with_temperature"]

_COPIES: Final = 4
_WIND: Final = ("x_wind", "y_wind", "upward_air_velocity")


def read_air(
    source: str | Path | Sequence[str | Path] | xr.Dataset,
    *,
    crop: Crop | None = None,
    names: Mapping[str, str] | None = None,
    wind: bool = False,
    available: Callable[[], int | None] = available_memory,
) -> xr.Dataset:
    """Read air from Zarr stores and netCDF files, in SI on the axes time, z, y, x.

    Parameters
    ----------
    source : path, pattern, sequence of paths, or xarray.Dataset
        A Zarr store, a netCDF file, a folder or pattern of netCDF files that hold different variables or
        follow each other in time; a box may follow as in ``les.nc@x=0:200,z=:50,time=600:``. It holds
        ``air_temperature``, ``air_potential_temperature`` or ``air_refractivity`` on any of (time, z, y, x),
        at least z; optionally ``surface_temperature``, ``air_pressure``, ``relative_humidity`` or
        ``specific_humidity``: under these names, as CF ``standard_name``, or as PALM, MicroHH, WRF and others
        call them (`nigemizu.heat.reading.names`). Axes are recognised by the CF attributes ``axis``,
        ``standard_name`` and ``positive`` or by their names.
    crop : mapping of str to (float or None, float or None), optional
        Ranges of x, y, z (m) and time (s), ends included, None where open. Nothing outside is read.
    names : mapping of str to str, optional
        Our names to the file's, where it calls things otherwise.
    wind : bool
        Whether ``x_wind``, ``y_wind`` and ``upward_air_velocity`` (m/s) come along, brought to the places of
        the temperature where they stand on faces.
    available : callable
        Tells the bytes of memory at hand, or None if unknown (then nothing is refused for its size).

    Returns
    -------
    xarray.Dataset
        With those variables only, renamed, converted to SI (K, Pa, 1, m) and transposed to (time, z, y, x);
        axes that the source lacks are absent. Time is in s, from the first instant when the source gives
        dates. The values stay in the file until they are used. A potential temperature is one of
        temperature where the pressure is known, and else stays as it is until `refractivity_at` or
        `complete` know the pressure at the ground.

    Raises
    ------
    InputError
        The file is missing or is no dataset; no such variable (what there is is listed); missing values above
        the ground (where, and how many); an axis that is not in order; units of the wrong kind; values that
        no air has; a single instant that does not fit the memory; a box outside the air.

    Notes
    -----
    Axes and values without ``units`` are taken as SI; falling axes are turned round. Missing values at the
    bottom of a column lie below the ground and become the lowest value above it; see
    `nigemizu.heat.reading.values` for what is missing and when values are looked at.
    """
    box: dict[str, Any] = {}
    if isinstance(source, str | Path):
        path, box = split_crop(str(source))
        source = path
    name = None if isinstance(source, xr.Dataset) else _called(source)
    dataset = from_wrf(source if isinstance(source, xr.Dataset) else open_dataset(source), name)
    limits = checked_crop({**box, **(crop or {})}, name)
    found = find_variables(dataset, names, wind, name)
    main = next(
        ours for ours in ("air_temperature", "air_potential_temperature", "air_refractivity") if ours in found
    )
    parts = {ours: placed(dataset[theirs], limits, name) for ours, theirs in found.items()}
    _require_axes(parts[main], main, limits, tuple(dataset[found[main]].dims), name)
    home = {}
    for ours, part in parts.items():
        if name is not None:
            _require_memory(part.array, found[ours], name, available)
        home[ours] = bring_home(part, ours, name)
        if ours in _WIND:
            home[ours] = centred(home[ours], parts[main].axes)
    _settle(home, dataset, found, name)
    try:
        result = xr.merge(list(home.values()), join="exact", compat="equals", combine_attrs="override")
    except (ValueError, xr.MergeError) as error:
        raise InputError(
            "the variables lie on different axes",
            file=name,
            key=", ".join(found.values()),
            expected="the same x, y, z and time for all",
        ) from error
    return result.assign_attrs(dataset.attrs)


def _called(source: str | Path | Sequence[str | Path]) -> str:
    if isinstance(source, str | Path):
        return str(source)
    return f"{source[0]} and {len(source) - 1} more" if len(source) > 1 else ", ".join(map(str, source))


def _require_axes(
    part: Placed, main: str, limits: Mapping[str, Any], dims: tuple[Any, ...], file: str | None
) -> None:
    if "z" not in part.axes:
        raise InputError(f"{main} has no height axis", file=file, key=main, value=dims)
    for axis in limits:
        if axis not in part.axes:
            raise InputError("the air has no such axis to crop", file=file, key=f"crop.{axis}", value=dims)


def _settle(
    home: dict[str, xr.DataArray], dataset: xr.Dataset, found: dict[str, str], file: str | None
) -> None:
    """Make the temperature and the specific humidity of what stands in for them, as far as can be."""
    if "air_potential_temperature" in home:
        theta = home["air_potential_temperature"]
        reference = reference_pressure(dataset[found["air_potential_temperature"]], dataset, file)
        home["air_potential_temperature"] = theta = theta.assign_attrs(reference_pressure=reference)
        if "air_pressure" in home and set(home["air_pressure"].dims) <= set(theta.dims):
            home["air_temperature"] = absolute(theta, home["air_pressure"])
            del home["air_potential_temperature"]
    if "humidity_mixing_ratio" in home:
        ratio = home.pop("humidity_mixing_ratio")

        def compute(blocks: list[NDArray[Any]], _: list[NDArray[np.intp]]) -> NDArray[Any]:
            return np.asarray(blocks[0] / (1.0 + blocks[0]))

        axes = {str(axis): ratio[axis] for axis in ratio.dims}
        home["specific_humidity"] = computed(compute, [ratio], axes).rename("specific_humidity")
        home["specific_humidity"].attrs["units"] = "1"


def _require_memory(array: xr.DataArray, called: str, file: str, available: Callable[[], int | None]) -> None:
    """Refuse an instant that cannot be held: as it is read, in double precision, and as an index."""
    values = array.size // max(array.sizes.get("time", 1), 1)
    need, have = _COPIES * 8 * values, available()
    if have is not None and need > have:
        raise InputError(
            f"one instant of {values:,} values needs {need / 2**30:.2f} GiB of memory, "
            f"and {have / 2**30:.2f} GiB are available",
            file=file,
            key=called,
            remedy="cut out or coarsen the part that light crosses: AIR@x=0:100,z=:20",
        )
