"""Finding the cell of a coordinate on a uniform or an arbitrarily spaced axis."""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from typing import Any, Final, NamedTuple, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.field.types import Types

__all__ = ["Axis", "BucketAxis", "Span", "UniformAxis", "make_axis"]

UNIFORM_TOLERANCE: Final = 1e-6  # of the spacing: below what single precision can tell from uniform
MOST_BUCKETS: Final = 1 << 17
FEW_CORRECTIONS: Final = 1  # nodes allowed inside one bucket before the buckets are made finer
NEAR_FACE: Final = 1e-4  # of the thinnest cell: as near to a face as this, a ray is on it
ROUNDINGS: Final = 4  # units in the last place by which a ray that was sent to a face may miss it


class Span(NamedTuple):
    """One cell of an axis, for each ray."""

    index: Any  #          UInt32        number of the lower node; that of the last node beyond it
    node: Any  #           Float   m     a finite coordinate, from which offsets within the cell are taken
    inverse_width: Any  #  Float   1/m   0 outside the nodes, where nothing changes along the axis
    lower: Any  #          Float   m     `Axis.outer` below the first node of an extended axis
    upper: Any  #          Float   m     the same above the last one


class Axis(ABC):
    """Nodes x₀ < x₁ < … of one axis; cell i spans [xᵢ, xᵢ₊₁), the last cell is closed.

    Attributes
    ----------
    outer : (float, float), m
        Where the cells outside the nodes of an extended axis end.
    """

    def __init__(self, nodes: NDArray[np.float64], types: Types) -> None:
        self._types = types
        self._first = float(nodes[0])
        self._last = float(nodes[-1])
        self._cells = len(nodes) - 1
        self.outer = (-np.inf, np.inf)
        self._near = NEAR_FACE * float(np.diff(nodes).min())
        self._rounding = ROUNDINGS * (2.0**-23 if types.precision == "single" else 2.0**-52)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self._cells

    @abstractmethod
    def locate(self, coordinate: Any, active: Any = True) -> tuple[Any, Any, Any]:
        """Cell of a coordinate, which is first clamped to the axis.

        Returns
        -------
        index : UInt32 — cell i
        fraction : Float — (x − xᵢ)/(xᵢ₊₁ − xᵢ), in [0, 1]
        inverse_width : Float or float — 1/(xᵢ₊₁ − xᵢ)
        """

    def locate_ahead(
        self, coordinate: Any, direction: Any, active: Any = True, *, extended: bool = False
    ) -> Span:
        """Cell that a moving coordinate is about to cross.

        Parameters
        ----------
        coordinate : Float, m
        direction : Float, 1
            Which way it moves: on a face, or as near to one as rounding can tell, the cell ahead is
            taken, unless there is none.
        active : Bool
        extended : bool
            Take what lies outside the nodes for cells that reach to `outer` and in which nothing
            changes; otherwise the outermost cells are taken there.

        Returns
        -------
        Span
        """
        slack = dr.fma(abs(coordinate), self._rounding, self._near)
        x = coordinate + dr.select(direction > 0, slack, dr.select(direction < 0, -slack, 0))
        span = self._span(x, active)
        if not extended:
            return span
        below, above = x < self._first, x > self._last
        node = dr.select(above, self._last, span.node)
        return Span(
            index=dr.select(above, self._cells, span.index),
            node=node,
            # Two plain numbers would make the choice between them single precision.
            inverse_width=dr.select(below | above, self._types.Float(0), span.inverse_width),
            lower=dr.select(below, self._types.Float(self.outer[0]), node),
            upper=dr.select(
                below, self._first, dr.select(above, self._types.Float(self.outer[1]), span.upper)
            ),
        )

    @abstractmethod
    def node(self, index: Any, active: Any = True) -> Any:
        """Coordinate (Float, m) of a node by its number (UInt32), the same to the bit in all spans."""

    @abstractmethod
    def _span(self, x: Any, active: Any) -> Span:
        """Cell of a coordinate, the outermost one outside the nodes."""


@final
class UniformAxis(Axis):
    """Equally spaced nodes: the cell is floor((x − x₀)/Δx)."""

    def __init__(self, nodes: NDArray[np.float64], types: Types) -> None:
        super().__init__(nodes, types)
        self._inverse_width = self._cells / (self._last - self._first)

    def locate(self, coordinate: Any, active: Any = True) -> tuple[Any, Any, Any]:
        scaled = (coordinate - self._first) * self._inverse_width
        scaled = dr.clip(scaled, 0, float(self._cells))
        index = dr.minimum(self._types.UInt32(scaled), self._cells - 1)
        return index, scaled - self._types.Float(index), self._inverse_width

    def node(self, index: Any, active: Any = True) -> Any:
        # The last node is the face of the field: not a rounding beside it.
        within = dr.fma(self._types.Float(index), 1 / self._inverse_width, self._first)
        return dr.select(index >= self._cells, self._last, within)

    def _span(self, x: Any, active: Any) -> Span:
        scaled = (x - self._first) * self._inverse_width
        index = self._types.UInt32(dr.clip(scaled, 0, float(self._cells - 1)))
        lower, upper = self.node(index), self.node(index + 1)
        return Span(index, lower, self._inverse_width, lower, upper)


@final
class BucketAxis(Axis):
    """Nodes with any spacing: a table over buckets gives a cell, comparisons make it exact.

    The bucket of x is the leading bits of the floating-point number x − x₀ + c. Such buckets are equal
    within a factor of two and widen with x, as stretched meshes do: a few hundred serve a mesh from
    millimetres to metres, and the table stays in the fastest cache. The table holds, per bucket, the last
    node at or before its lower edge. A coordinate in the bucket then passes at most `corrections` further
    nodes, each found by one comparison.
    """

    def __init__(self, nodes: NDArray[np.float64], types: Types) -> None:
        super().__init__(nodes, types)
        dtype = np.float32 if types.precision == "single" else np.float64
        # Compared in the precision of the coordinates, so that the cell is the one searchsorted finds.
        stored = nodes.astype(dtype)
        if not np.all(np.diff(stored) > 0):
            raise InputError(
                "the axis has cells too thin for single precision", remedy="use double precision"
            )
        table, self._offset, self._shift, self.corrections = _known_table(stored.tobytes(), stored.dtype.str)
        self._origin = float(stored[0])
        self._key = int(_key(np.float32(self._offset), self._shift))
        self.buckets = len(table)
        self._table = types.UInt32(table)
        self._nodes = types.Float(stored)
        self._inverse_widths = types.Float((1.0 / np.diff(nodes)).astype(dtype))
        self._packets = self._pack(table, stored)

    def locate(self, coordinate: Any, active: Any = True) -> tuple[Any, Any, Any]:
        types = self._types
        x = dr.clip(coordinate, self._first, self._last)
        bucket = self._bucket(x)
        index = dr.gather(types.UInt32, self._table, bucket, active)
        for _ in range(self.corrections - 1):
            above = dr.gather(types.Float, self._nodes, index + 1, active)
            index = dr.select((x >= above) & (index < self._cells - 1), index + 1, index)
        # The last comparison also gives the fraction, from whichever side of the node x lies on.
        node = dr.gather(types.Float, self._nodes, index + 1, active)
        passed = (x >= node) & (index < self._cells - 1)
        index = dr.select(passed, index + 1, index)
        inverse_width = dr.gather(types.Float, self._inverse_widths, index, active)
        from_node = (x - node) * inverse_width
        return index, dr.clip(dr.select(passed, from_node, 1 + from_node), 0, 1), inverse_width

    def node(self, index: Any, active: Any = True) -> Any:
        return dr.gather(self._types.Float, self._nodes, index, active)

    def _span(self, x: Any, active: Any) -> Span:
        types = self._types
        x = dr.clip(x, self._first, self._last)
        if self._packets is None:
            index, _, inverse_width = self.locate(x, active)
            lower, upper = self.node(index, active), self.node(index + 1, active)
            return Span(index, lower, inverse_width, lower, upper)
        # One access gives the cell and, if a node is passed, the next one.
        packet = dr.gather(types.Array4f, self._packets, self._bucket(x), active)
        index = types.UInt32(packet[0])
        passed = (x >= packet[2]) & (index < self._cells - 1)
        index = dr.select(passed, index + 1, index)
        lower = dr.select(passed, packet[2], packet[1])
        upper = dr.select(passed, packet[3], packet[2])
        inverse_width = dr.gather(types.Float, self._inverse_widths, index, active)
        return Span(index, lower, inverse_width, lower, upper)

    def _bucket(self, x: Any) -> Any:
        raised = self._types.Float32(x - self._origin) + self._offset
        bits: Any = dr.reinterpret_array(self._types.UInt32, raised)
        return dr.minimum((bits >> self._shift) - self._key, self.buckets - 1)

    def _pack(self, table: NDArray[np.uint32], nodes: NDArray[Any]) -> Any:
        """Per bucket its cell and the three nodes from there on; None if a bucket may pass more than one."""
        if self.corrections > 1 or self._cells >= 1 << 24:  # beyond which single precision cannot count
            return None
        following = np.minimum(table[:, None] + np.arange(3), self._cells)
        return self._types.table(np.column_stack([table, nodes[following]]))


def make_axis(nodes: ArrayLike, types: Types, *, key: str) -> Axis:
    """The axis with these nodes (m): uniform if they are equally spaced, else with a bucket table."""
    values = np.asarray(nodes, dtype=np.float64)
    if values.ndim != 1 or len(values) < 2:
        raise InputError("an axis needs at least two nodes", key=key, value=values.shape)
    spacing = np.diff(values)
    if not np.all(np.isfinite(values)) or not np.all(spacing > 0):
        raise InputError("the axis does not increase", key=key, expected="finite, strictly increasing nodes")
    even = np.linspace(values[0], values[-1], len(values))
    if np.max(np.abs(values - even)) <= UNIFORM_TOLERANCE * spacing.min():
        return UniformAxis(values, types)
    return BucketAxis(values, types)


def _key(raised: Any, shift: int) -> Any:
    """Leading bits of single-precision numbers."""
    return np.asarray(raised, dtype=np.float32).view(np.uint32) >> shift


@functools.lru_cache(maxsize=8)
def _known_table(nodes: bytes, dtype: str) -> tuple[NDArray[np.uint32], float, int, int]:
    """`_best_table`, found once for the nodes that one air after the other has."""
    found = _best_table(np.frombuffer(nodes, dtype=dtype))
    found[0].flags.writeable = False
    return found


def _best_table(nodes: NDArray[Any]) -> tuple[NDArray[np.uint32], float, int, int]:
    """The shortest table that needs few corrections, with its offset c [m], shift and corrections."""
    span = float(nodes[-1]) - float(nodes[0])
    thinnest = float(np.diff(nodes.astype(np.float64)).min())
    offsets = [thinnest * 2.0**power for power in range(int(np.log2(span / thinnest)) + 3)]
    best: tuple[NDArray[np.uint32], float, int, int] | None = None
    for shift in range(22, 7, -1):
        for offset in offsets:
            ends = np.array([offset, 1.0001 * (span + offset)], dtype=np.float32)
            if int(np.subtract(*_key(ends[::-1], shift).astype(np.int64))) >= MOST_BUCKETS:
                continue
            table, corrections = _bucket_table(nodes, float(ends[0]), shift, float(ends[1]))
            if best is None or corrections < best[3]:
                best = table, float(ends[0]), shift, corrections
            if corrections <= FEW_CORRECTIONS:
                return table, float(ends[0]), shift, corrections
    assert best is not None  # the coarsest shift has a handful of buckets
    return best


def _bucket_table(
    nodes: NDArray[Any], offset: float, shift: int, top: float
) -> tuple[NDArray[np.uint32], int]:
    """Cell at the lower edge of each bucket, and the most nodes that one bucket can pass."""
    first, last = (int(_key(np.float32(value), shift)) for value in (offset, top))
    keys = np.arange(first, last + 2, dtype=np.uint32)
    raised = (keys << np.uint32(shift)).view(np.float32).astype(np.float64)
    # Round-off may put a coordinate into the neighbouring bucket: look beyond the edges by as much.
    reach = max(abs(float(nodes[0])), abs(float(nodes[-1])))
    slack = 4 * np.finfo(np.float32).eps * raised + 4 * np.finfo(nodes.dtype).eps * reach
    edges = raised - offset + float(nodes[0])
    cells = len(nodes) - 1
    start = np.clip(np.searchsorted(nodes, (edges - slack)[:-1], side="right") - 1, 0, cells - 1)
    end = np.clip(np.searchsorted(nodes, (edges + slack)[1:], side="right") - 1, 0, cells - 1)
    return start.astype(np.uint32), max(1, int(np.max(end - start)))
