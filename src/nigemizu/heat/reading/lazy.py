"""Arrays that are computed from others when a part of them is read, and hold nothing until then."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import DTypeLike, NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

__all__ = ["Compute", "computed"]

Compute: TypeAlias = Callable[[list[NDArray[Any]], list[NDArray[np.intp]]], NDArray[Any]]
"""Makes a block of values from the same block of the sources and from its indices along every axis."""


def computed(
    compute: Compute,
    sources: Sequence[xr.DataArray],
    axes: Mapping[str, xr.DataArray],
    *,
    dtype: DTypeLike = np.float64,
    whole: Sequence[str] = (),
) -> xr.DataArray:
    """An array whose values are computed block by block, when they are read.

    Parameters
    ----------
    compute : callable
        Gets the blocks of the sources, each with as many axes as the result (length 1 along those that a
        source lacks), and the indices of the block along each axis.
    sources : sequence of xarray.DataArray
        Their dimensions are among `axes`, in any order.
    axes : mapping of str to xarray.DataArray
        Coordinates of the result, in order.
    dtype : dtype
        Of the result.
    whole : sequence of str
        Dimensions along which a block is always read as a whole, because neighbours matter. Along them a
        source may have another length than the result.

    Returns
    -------
    xarray.DataArray

    Notes
    -----
    Nothing is kept: what is read twice is computed twice.
    """
    backend = _Computed(compute, [source.variable for source in sources], axes, np.dtype(dtype), whole)
    variable = xr.Variable(tuple(axes), indexing.LazilyIndexedArray(backend))
    return xr.DataArray(variable, coords=dict(axes))


class _Computed(BackendArray):
    def __init__(
        self,
        compute: Compute,
        sources: list[xr.Variable],
        axes: Mapping[str, xr.DataArray],
        dtype: np.dtype[Any],
        whole: Sequence[str],
    ) -> None:
        self.shape = tuple(axis.size for axis in axes.values())
        self.dtype = dtype
        self._compute, self._sources, self._axes, self._whole = compute, sources, tuple(axes), tuple(whole)

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key: tuple[Any, ...]) -> NDArray[Any]:
        read: dict[Hashable, Any] = {}
        rest = []  # what is left to be picked from the block
        for axis, part in zip(self._axes, key, strict=True):
            number = isinstance(part, int | np.integer)
            if axis in self._whole:
                read[axis] = slice(None)
                rest.append(part)
            else:
                read[axis] = slice(int(part), int(part) + 1) if number else part
                rest.append(0 if number else slice(None))
        blocks = [self._block(source, read) for source in self._sources]
        places = [np.arange(size)[read[axis]] for axis, size in zip(self._axes, self.shape, strict=True)]
        values = self._compute(blocks, places)
        for place in reversed(range(len(rest))):
            values = values[(slice(None),) * place + (rest[place],)]
        return values

    def _block(self, source: xr.Variable, read: Mapping[Hashable, Any]) -> NDArray[Any]:
        part = source.isel({name: read[name] for name in source.dims})
        # Transposed once it is in memory: files read pieces in their own order, or one value at a time.
        held = np.asarray(part.values).transpose(
            [part.dims.index(axis) for axis in self._axes if axis in part.dims]
        )
        return held[tuple(slice(None) if axis in part.dims else None for axis in self._axes)]
