"""Writing air to Zarr stores and netCDF files, instant by instant."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
import xarray as xr

from nigemizu.errors import InputError, MachineError
from nigemizu.output.files import whole_file, whole_folder

__all__ = ["write_air"]

_TIMES_PER_CHUNK: Final = 4096


def write_air(air: xr.Dataset | Iterable[xr.Dataset], path: str | Path) -> Path:
    """Write air to a file that any CF-aware program opens.

    Parameters
    ----------
    air : xarray.Dataset, or iterable of xarray.Dataset
        One dataset; or datasets that follow each other along ``time``, of which only one is held at a time.
    path : path
        ``.zarr`` (a folder; one chunk per variable and instant) or ``.nc`` (netCDF-4, compressed).

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Unknown extension, nothing to write, instants that do not fit together, or a path that cannot be
        written to.
    MachineError
        The disk is full.

    Notes
    -----
    Values keep their precision and are compressed without loss. The file has its name only once it is whole.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in (".zarr", ".nc"):
        raise InputError("unknown kind of dataset", file=str(target), value=suffix, expected=".zarr or .nc")
    instants = _instants(air)
    first = next(instants, None)
    if first is None:
        raise InputError("there is no air to write", file=str(target))
    if suffix == ".zarr":
        with whole_folder(target) as folder:
            _write_zarr(folder, first, instants)
    else:
        with whole_file(target) as file:
            _write_netcdf(file, first, instants, target)
    return target


def _instants(air: xr.Dataset | Iterable[xr.Dataset]) -> Iterator[xr.Dataset]:
    for dataset in [air] if isinstance(air, xr.Dataset) else air:
        if "time" not in dataset.dims:
            yield dataset
            continue
        for index in range(dataset.sizes["time"]):
            yield dataset.isel(time=slice(index, index + 1))


def _later(first: xr.Dataset, instant: xr.Dataset) -> xr.Dataset:
    """What of a later instant is new: its variables in time, once they are known to fit the first."""
    names = [str(name) for name, variable in first.data_vars.items() if "time" in variable.dims]
    fits = all(
        name in instant
        and instant[name].dims == first[name].dims
        and instant[name].shape == first[name].shape
        for name in names
    )
    if "time" not in first.dims or "time" not in instant.dims or not fits:
        raise InputError(
            "an instant of the air does not fit the first one",
            key="air",
            value=dict(instant.sizes),
            expected=f"the variables {', '.join(names)} on {dict(first.sizes)}",
        )
    return instant[names]


def _encoding(first: xr.Dataset, **options: Any) -> dict[str, dict[str, Any]]:
    encoding: dict[str, dict[str, Any]] = {}
    for name, variable in first.variables.items():
        encoding[str(name)] = {"_FillValue": None} if variable.dtype.kind == "f" else {}
        if variable.ndim > 1:
            encoding[str(name)] |= options
    return encoding


def _write_zarr(folder: Path, first: xr.Dataset, later: Iterator[xr.Dataset]) -> None:
    import zarr

    encoding = _encoding(first)
    for name, variable in first.variables.items():
        # One chunk per instant for volumes, many instants per chunk for short things such as time itself.
        chunks = [_TIMES_PER_CHUNK if variable.size < 256 else 1] if "time" in variable.dims else []
        chunks += [size for dimension, size in variable.sizes.items() if dimension != "time"]
        if variable.ndim:
            encoding[str(name)]["chunks"] = tuple(chunks)
    plain = first.drop_encoding()
    plain.to_zarr(folder, mode="w", consolidated=False, encoding=encoding)
    for instant in later:
        _later(first, instant).drop_encoding().to_zarr(
            folder, mode="a", append_dim="time", consolidated=False
        )
    with warnings.catch_warnings():
        # Zarr says that its third format has not settled this yet; xarray warns where it is missing.
        warnings.filterwarnings("ignore", "Consolidated metadata", category=UserWarning)
        zarr.consolidate_metadata(folder)


def _write_netcdf(file: Path, first: xr.Dataset, later: Iterator[xr.Dataset], target: Path) -> None:
    import netCDF4

    timed = ["time"] if "time" in first.dims else []
    encoding = _encoding(first, zlib=True, complevel=1, shuffle=True)
    with _hdf5_errors(target):
        first.drop_encoding().to_netcdf(
            file, engine="netcdf4", format="NETCDF4", unlimited_dims=timed, encoding=encoding
        )
        store = netCDF4.Dataset(file, "a")
    try:
        for index, instant in enumerate(later, start=1):
            new = _later(first, instant)
            with _hdf5_errors(target):
                for name, variable in new.variables.items():
                    if "time" in variable.dims:
                        store[str(name)][index] = np.asarray(variable.values)[0]
    finally:
        with _hdf5_errors(target):
            store.close()


@contextmanager
def _hdf5_errors(target: Path) -> Iterator[None]:
    try:
        yield
    except RuntimeError as error:  # the HDF5 library has no better word for a full or failing disk
        raise MachineError(f"{target}: writing failed: {error}; is the disk full?") from error
