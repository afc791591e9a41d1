"""Layers of numbers per pixel: OpenEXR with named channels, and netCDF."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nigemizu.output.files import whole_file, write_bytes
from nigemizu.output.provenance import Provenance

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["read_layers", "write_layers", "write_pixels"]


def write_layers(
    path: str | Path, layers: Mapping[str, ArrayLike], *, provenance: Provenance | None = None
) -> Path:
    """Write an OpenEXR file of 32-bit channels.

    Parameters
    ----------
    path : path
    layers : mapping of str to (height, width) array_like
        Channels by their names, such as ``displacement.x``; R, G and B make it a picture as well. Infinite
        values and NaN are kept.
    provenance : Provenance, optional
        Kept in the header.
    """
    import OpenEXR

    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header |= {name.lower(): text for name, text in (provenance or Provenance()).fields().items()}
    channels = {name: np.ascontiguousarray(values, dtype=np.float32) for name, values in layers.items()}
    buffer = io.BytesIO()
    OpenEXR.File(header, channels).write(buffer)
    return write_bytes(Path(path), buffer.getvalue())


def read_layers(path: str | Path) -> dict[str, np.ndarray]:
    """The channels of an OpenEXR file, (height, width) float32 each."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.array(channel.pixels) for name, channel in file.channels().items()}


def write_pixels(path: str | Path, dataset: xr.Dataset) -> Path:
    """Write a dataset on pixels to netCDF, whole or not at all."""
    target = Path(path)
    encoding = {str(name): {"zlib": True, "complevel": 1} for name in dataset.data_vars}
    with whole_file(target) as file:
        dataset.to_netcdf(file, engine="netcdf4", format="NETCDF4", encoding=encoding)
    return target
