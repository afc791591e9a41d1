"""Opening air: one file, or several that belong together."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.heat.reading.lazy import computed

__all__ = ["open_dataset"]

_EXPECTED = "a Zarr store, a netCDF file, or a folder of netCDF files"
_ZARR = ("zarr.json", ".zgroup", ".zmetadata")


def open_dataset(source: str | Path | Sequence[str | Path]) -> xr.Dataset:
    """Open a dataset without reading its values.

    Parameters
    ----------
    source : path, pattern or sequence of paths
        A Zarr store, a netCDF file; a folder of netCDF files, a pattern such as ``run/*_3d.*.nc``, or
        several files: these hold different variables, or follow each other in time, or both.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        Nothing is there, it cannot be read, or the files do not fit together.
    """
    if not isinstance(source, str | Path):
        return _joined([Path(part) for part in source])
    path = Path(source).expanduser()
    if path.exists():
        if not path.is_dir() or any((path / name).exists() for name in _ZARR):
            return _open(path)
        files = sorted(path.glob("*.nc"))
        return _joined(files) if files else _open(path)
    files = [Path(name) for name in sorted(glob.glob(str(path)))] if glob.has_magic(str(path)) else []
    if not files:
        raise InputError("no such file", file=str(path), expected="air in a .zarr store or .nc file")
    return _joined(files)


def _open(path: Path) -> xr.Dataset:
    if not path.exists():
        raise InputError("no such file", file=str(path), expected="air in a .zarr store or .nc file")
    engine: Any = "zarr" if path.is_dir() else "netcdf4"
    options: dict[str, Any] = {"consolidated": False} if engine == "zarr" else {}
    try:
        # Times are decoded later, for units of duration and calendars alike; nothing read is kept.
        return xr.open_dataset(path, engine=engine, decode_times=False, chunks=None, cache=False, **options)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            "not a dataset that can be read",
            file=str(path),
            expected=_EXPECTED,
            remedy=f"the reader says: {error}",
        ) from error


def _joined(files: list[Path]) -> xr.Dataset:
    """Files with the same variables follow each other in time; the others stand side by side."""
    if not files:
        raise InputError("no file was given", key="source", expected=_EXPECTED)
    groups: dict[tuple[str, ...], list[tuple[Path, xr.Dataset]]] = {}
    for path in files:
        dataset = _open(path)
        groups.setdefault(tuple(sorted(map(str, dataset.data_vars))), []).append((path, dataset))
    parts = [_in_sequence(group) for group in groups.values()]
    if len(parts) == 1:
        return parts[0]
    try:
        return xr.merge(parts, join="exact", compat="no_conflicts", combine_attrs="override")
    except (ValueError, xr.MergeError) as error:
        raise InputError(
            "the files do not fit together",
            file=f"{files[0]} … {files[-1]}",
            expected="the same axes in all, and each variable once",
            remedy="; ".join(str(error).splitlines()[:1]),
        ) from error


def _in_sequence(group: list[tuple[Path, xr.Dataset]]) -> xr.Dataset:
    if len(group) == 1:
        return group[0][1]
    name = next((name for name in ("time", "Time", "t") if name in group[0][1].coords), None)
    if name is None:
        raise InputError(
            "several files hold the same variables and no time",
            file=", ".join(str(path) for path, _ in group),
        )
    group = sorted(group, key=lambda entry: float(entry[1][name].values.min()))
    first_path, first = group[0]
    stamps = np.concatenate([dataset[name].values for _, dataset in group])
    for path, dataset in group[1:]:
        same = all(
            axis == name
            or (axis in first.coords and np.array_equal(first[axis].values, dataset[axis].values))
            for axis in dataset.coords
        )
        if not same or dataset[name].attrs.get("units") != first[name].attrs.get("units"):
            raise InputError(
                "this file does not continue the other", file=str(path), expected=f"the axes of {first_path}"
            )
    time = xr.DataArray(stamps, {name: stamps}, name, attrs=first[name].attrs)
    lengths = [dataset.sizes[name] for _, dataset in group]
    later = {}
    for key, array in first.data_vars.items():
        if name in array.dims:
            pieces = [dataset[key] for _, dataset in group]
            later[key] = _one_after_another(pieces, lengths, name, time).assign_attrs(array.attrs)
    return first.drop_dims(name).assign(later).assign_coords({name: time}).assign_attrs(first.attrs)


def _one_after_another(
    pieces: list[xr.DataArray], lengths: list[int], name: str, time: xr.DataArray
) -> xr.DataArray:
    """The pieces as one array in time; only those that hold what is asked for are read."""
    ends = np.cumsum(lengths)
    axes = {str(axis): time if axis == name else pieces[0][axis] for axis in pieces[0].dims}

    def compute(_: list[NDArray[Any]], places: list[NDArray[np.intp]]) -> NDArray[Any]:
        blocks = []
        order = dict(zip(axes, places, strict=True))
        for instant in order[name]:
            number = int(np.searchsorted(ends, instant, side="right"))
            local = int(instant - ends[number] + lengths[number])
            picked = {axis: along for axis, along in order.items() if axis != name}
            blocks.append(pieces[number].variable.isel({name: slice(local, local + 1), **picked}).values)
        return np.concatenate(blocks, axis=list(axes).index(name))

    return computed(compute, [], axes, dtype=np.result_type(*[piece.dtype for piece in pieces]))
