"""Paths on a screen grid that is as fine as the air demands: what the rays between them share."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.field import Field
from nigemizu.trace.scout import BLOCK, Segments
from nigemizu.trace.stations import fly_places
from nigemizu.trace.table import RECORD, PathTable, records_of
from nigemizu.trace.view import View

__all__ = ["OpenGrid", "displaced", "fly_nodes", "refine"]

FloatArray = NDArray[np.float64]
Array = NDArray[np.floating[Any]]

_FEWEST: Final = (2, 2)  # cells of a block, across and down, between the nodes whose rays are flown
_MOST: Final = (16, 64)
_FINEST: Final = (32, 128)  # the same of the table, which is linear in between
_LOCAL: Final = 4  # degree of the polynomials that lead from one to the other
_GAIN: Final = 0.25  # of what the coarser grid misses, that the finer one may miss
_WORTH: Final = 0.3  # nodes per ray
_CHANCE: Final = 0.3  # of the blocks; where more need the second grid, the rest pass the first by chance
_POLYNOMIAL, _LINEAR = 0.35, 0.25  # of the accuracy, for each of the two and each direction


def refine(
    field: Field,
    view: View,
    segments: Segments,
    *,
    accuracy: float,
    integration: float,
    max_steps: int,
    rays: float = np.inf,
) -> tuple[PathTable, list[OpenGrid]]:
    """Fly the rays of the nodes, on finer and finer grids where the interpolation is not good enough.

    Parameters
    ----------
    field, view, segments
        As for, and from, `scout`.
    accuracy : float, rad
        Displacement that sharing may add.
    integration : float, rad
        Accuracy of the nodes' paths.
    max_steps : int
    rays : float
        Rays that will pass through each block: more nodes than a share of them are not worth it.

    Returns
    -------
    PathTable
    list of OpenGrid
        The blocks that are not shared as a whole, with the nodes that have been flown.

    Notes
    -----
    Across and down by themselves: the nodes that the next coarser grid lacks are compared with the
    polynomial of degree 1, 2 or 4 through the coarser one's. A quarter of the difference is taken as the
    error of the polynomial through all of them (Lagrange's, of degree 2 or 4). Where it is too large the
    cells are halved; else the table's own grid is filled from the polynomials, so finely that between its
    nodes it may be linear. A block whose finest grid does not suffice, or would have too many nodes if each
    halving brought the error down to a quarter, or which has a ray that runs out of steps, is not shared as a
    whole (but see `nigemizu.trace.cellwise`).
    """
    table = _Table(len(segments.count))
    flown, steps = 0, 0.0
    given_up: list[OpenGrid] = []
    all_ = np.flatnonzero(~segments.lost)
    waiting = [OpenGrid(_FEWEST, all_, None, (1, 1))] if len(all_) else []
    while waiting:
        round_ = fly_nodes(field, view, segments, waiting, integration, max_steps)
        flown += round_.rays
        steps += round_.steps
        next_: dict[tuple[Any, Any], list[OpenGrid]] = {}
        for part, states, lost in zip(waiting, round_.states, round_.lost, strict=True):
            blocks = part.blocks
            wrong = [
                _GAIN * _displacement(*_against_coarser(states, axis), segments, blocks) for axis in (0, 1)
            ]
            coarse = [(w > _POLYNOMIAL * accuracy) & ~lost for w in wrong]
            if part.states is None:
                coarse = [~lost if np.mean(c) > _CHANCE else c for c in coarse]
            good = np.flatnonzero(~coarse[0] & ~coarse[1] & ~lost)
            rest = coarse[0] | coarse[1]
            worth = _nodes(part.grid, wrong, _POLYNOMIAL * accuracy) <= _WORTH * rays
            coarse = [c & worth for c in coarse]
            table.put(
                states[..., good], segments, blocks[good], (wrong[0] + wrong[1])[good], _LINEAR * accuracy
            )
            for finer, factors, members in _doubled(part.grid, coarse, _MOST):
                opened = OpenGrid(finer, blocks[members], states[..., members], factors)
                next_.setdefault((finer, factors), []).append(opened)
                rest[members] = False
            if np.any(rest):
                given_up.append(OpenGrid(part.grid, blocks[rest], states[..., rest], (1, 1)))
        waiting = [_merged(parts) for parts in next_.values()]
    return table.frozen(steps, flown), given_up


def _nodes(grid: tuple[int, int], wrong: list[FloatArray], accuracy: float) -> FloatArray:
    """How many nodes each block would need in the end, if each halving left a quarter of the error."""
    across, down = (n * np.maximum(np.sqrt(w / accuracy), 1) + 1 for n, w in zip(grid, wrong, strict=True))
    return np.asarray(across * down)


@final
@dataclass(frozen=True)
class OpenGrid:
    """Blocks on a grid that is to be flown, the states of a coarser one (None at first), and how much finer
    the grid is than that."""

    grid: tuple[int, int]
    blocks: NDArray[np.intp]
    states: Array | None
    factors: tuple[int, int]

    def refined(self, grid: tuple[int, int]) -> OpenGrid:
        """The same blocks on another grid; the states go with them where its nodes include theirs."""
        factors = (grid[0] // self.grid[0], grid[1] // self.grid[1])
        within = factors[0] * self.grid[0] == grid[0] and factors[1] * self.grid[1] == grid[1]
        return OpenGrid(grid, self.blocks, self.states if within else None, factors if within else (1, 1))

    def part(self, chosen: NDArray[np.intp] | slice) -> OpenGrid:
        """Some of the blocks."""
        states = None if self.states is None else self.states[..., chosen]
        return OpenGrid(self.grid, self.blocks[chosen], states, self.factors)


def _merged(parts: list[OpenGrid]) -> OpenGrid:
    """Blocks that need the same grid, as one."""
    states = np.concatenate([part.states for part in parts if part.states is not None], axis=-1)
    return OpenGrid(parts[0].grid, np.concatenate([part.blocks for part in parts]), states, parts[0].factors)


def _doubled(
    grid: tuple[int, int], coarse: list[NDArray[np.bool_]], most: tuple[int, int]
) -> Iterator[tuple[tuple[int, int], tuple[int, int], NDArray[np.intp]]]:
    """The next finer grids, the factors, and the members that are too coarse across, down, or both."""
    for factors in ((2, 1), (1, 2), (2, 2)):
        finer = (grid[0] * factors[0], grid[1] * factors[1])
        members = np.flatnonzero((coarse[0] == (factors[0] > 1)) & (coarse[1] == (factors[1] > 1)))
        if finer[0] <= most[0] and finer[1] <= most[1] and len(members):
            yield finer, factors, members


class _Table:
    """The table while it is being filled; arguments and results as in `PathTable`."""

    def __init__(self, blocks: int) -> None:
        self.cells = np.zeros((blocks, 2), dtype=np.uint32)
        self.base = np.zeros(blocks, dtype=np.uint32)
        self.error = np.zeros(blocks)
        self.kept: list[Array] = []
        self.size = 0

    def put(
        self, states: Array, segments: Segments, blocks: NDArray[np.intp], wrong: FloatArray, accuracy: float
    ) -> None:
        """Fill the grids of some blocks, each as finely as it takes for the table to be linear in between.

        Between nodes at the distance h linear interpolation misses h² |f″|/8, an eighth of the second
        difference; with h it falls to a quarter for each halving.
        """
        if not len(blocks):
            return
        grid = (states.shape[1] - 1, states.shape[0] - 1)
        cells, missed = [], []
        for axis, most in enumerate(_FINEST):
            ahead, behind, middle = _moved(states, axis, 2), _moved(states, axis, 0), _moved(states, axis, 1)
            second = _displacement(0.5 * (ahead + behind), middle, segments, blocks) / 4
            halvings = np.ceil(np.log2(np.maximum(second / accuracy, 1e-9)) / 2).astype(int)
            wanted = np.clip(grid[axis] * 2.0**halvings, _FEWEST[axis], most).astype(int)
            cells.append(wanted)
            missed.append(second * (grid[axis] / wanted) ** 2)
        error = wrong + missed[0] + missed[1]
        code = cells[0] * 1024 + cells[1]
        for value in np.unique(code):
            members = np.flatnonzero(code == value)
            pair = divmod(int(value), 1024)
            weights = [_lagrange(n, min(n, _LOCAL), c) for n, c in zip(grid, pair, strict=True)]
            self._keep(_spread(states[..., members], *weights), blocks[members], pair, error[members])

    def _keep(
        self, states: Array, blocks: NDArray[np.intp], cells: tuple[int, int], error: FloatArray
    ) -> None:
        rows, columns, stops, _, _ = states.shape
        records = records_of(states)
        per_block = stops * rows * columns
        self.base[blocks] = self.size + per_block * np.arange(len(blocks))
        self.cells[blocks] = cells
        self.error[blocks] = error
        self.kept.append(records.ravel())
        self.size += per_block * len(blocks)

    def frozen(self, steps: float, flown: int) -> PathTable:
        records = np.concatenate(self.kept) if self.kept else np.zeros(RECORD, dtype=np.float32)
        return PathTable(records, self.base, self.cells, self.error, steps / max(flown, 1), flown)


@final
@dataclass(frozen=True)
class _Round:
    """What one launch brought: per part the states (rows, columns, stops, 6, blocks), and the lost blocks."""

    states: list[Array]
    lost: list[NDArray[np.bool_]]
    steps: float
    rays: int


def fly_nodes(
    field: Field, view: View, segments: Segments, parts: list[OpenGrid], accuracy: float, max_steps: int
) -> _Round:
    """Fly the nodes that the coarser grids lack, those of all parts together."""
    stops = segments.start.shape[1] + 1
    fresh = [_fresh(part) for part in parts]
    if not any(mask.any() for mask in fresh):
        known = [part.states for part in parts if part.states is not None]
        return _Round(known, [np.zeros(len(part.blocks), dtype=bool) for part in parts], 0.0, 0)
    places = [_places(segments, part, mask) for part, mask in zip(parts, fresh, strict=True)]
    x, y = (np.concatenate([place[i] for place in places]) for i in (0, 1))
    lengths = np.concatenate([place[2] for place in places], axis=1)
    flown = fly_places(field, view, x, y, lengths, accuracy, max_steps)
    states, lost, at = [], [], 0
    for part, mask in zip(parts, fresh, strict=True):
        blocks, nodes = len(part.blocks), int(mask.sum())
        rays = slice(at, at + nodes * blocks)
        at += nodes * blocks
        filled = np.empty((*mask.shape, stops, 6, blocks), dtype=flown.states.dtype)
        # (6, stop, node, block) → (node, stop, 6, block)
        filled[mask] = flown.states[..., rays].reshape(6, stops, nodes, blocks).transpose(2, 1, 0, 3)
        if part.states is not None:
            filled[_known(part)] = part.states
        states.append(filled)
        lost.append(np.any(flown.lost[rays].reshape(nodes, blocks), axis=0))
    return _Round(states, lost, flown.steps, at)


def _known(part: OpenGrid) -> tuple[slice, slice]:
    return slice(None, None, part.factors[1]), slice(None, None, part.factors[0])


def _fresh(part: OpenGrid) -> NDArray[np.bool_]:
    """Which nodes (rows, columns) of a part's grid have not been flown yet."""
    fresh = np.ones((part.grid[1] + 1, part.grid[0] + 1), dtype=bool)
    if part.states is not None:
        fresh[_known(part)] = False
    return fresh


def _places(
    segments: Segments, part: OpenGrid, fresh: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Place of each ray (nodes · blocks) in pixels, and its path lengths (stops, nodes · blocks)."""
    blocks = part.blocks
    row, column = np.nonzero(fresh)
    down, across = (row / part.grid[1])[:, None], (column / part.grid[0])[:, None]
    corner = segments.start[blocks].T[..., None, :]  # (corner, segment, 1, block)
    upper, lower = (corner[i] + (corner[i + 1] - corner[i]) * across for i in (0, 2))
    lengths = np.empty((corner.shape[1] + 1, len(row), len(blocks)))
    lengths[:-1] = upper + (lower - upper) * down
    lengths[-1] = segments.last[blocks]
    y, x = np.divmod(blocks, segments.columns)
    return (
        ((x + across) * BLOCK[0]).ravel(),
        ((y + down) * BLOCK[1]).ravel(),
        lengths.reshape(len(lengths), -1),
    )


@functools.cache
def _lagrange(grid: int, degree: int, cells: int, between: bool = False) -> FloatArray:
    """Weights (places, grid + 1) of equally spaced nodes on [0, 1], for polynomials over `degree` cells each.

    The places are the nodes of a grid of `cells`, or only every second of them, from the second on.
    """
    places = np.linspace(0, 1, cells + 1)[1::2] if between else np.linspace(0, 1, cells + 1)
    weights = np.zeros((len(places), grid + 1))
    pieces = grid // degree
    piece = np.minimum((places * pieces).astype(int), pieces - 1)
    t = places * grid - piece * degree
    for i in range(degree + 1):
        others = [j for j in range(degree + 1) if j != i]
        weight = np.prod([(t - j) / (i - j) for j in others], axis=0)
        weights[np.arange(len(places)), piece * degree + i] = weight
    weights.flags.writeable = False
    return weights


def _spread(states: Array, across: FloatArray, down: FloatArray) -> Array:
    """States on another grid: the weights applied across and down."""
    return _weighted(_weighted(states.swapaxes(0, 1), across).swapaxes(0, 1), down)


def _weighted(states: Array, weights: FloatArray) -> Array:
    """Sums over the first axis. Not by BLAS, whose threads get into the way of those of the rays."""
    result = np.empty((len(weights), *states.shape[1:]), dtype=states.dtype)
    for row, weight in zip(result, weights.astype(states.dtype), strict=True):
        first, *others = np.flatnonzero(weight)
        np.multiply(states[first], weight[first], out=row)
        for other in others:
            row += states[other] * weight[other]
    return result


def _moved(states: Array, axis: int, start: int) -> Array:
    """All but two of the nodes across (0) or down (1), from `start` on."""
    count = states.shape[1 - axis] - 2
    return states[:, start : start + count] if axis == 0 else states[start : start + count]


def _against_coarser(states: Array, axis: int) -> tuple[Array, Array]:
    """Every second state across (0) or down (1), and what polynomials through the others give there."""
    if axis == 0:
        states = states.swapaxes(0, 1)
    grid = len(states) - 1
    weights = _lagrange(grid // 2, min(grid // 2, _LOCAL), grid, between=True)
    return states[1::2], _weighted(states[::2], weights)


def _displacement(states: Array, others: Array, segments: Segments, blocks: NDArray[np.intp]) -> FloatArray:
    """Largest displacement [rad], per block, between states (rows, columns, stops, 6, blocks)."""
    squares = np.square(states - others)
    offset, deflection = (
        np.sqrt((squares[:, :, :, i] + squares[:, :, :, i + 1] + squares[:, :, :, i + 2]).max(axis=(0, 1)))
        for i in (0, 3)
    )
    return displaced(offset, deflection, segments, blocks)


def displaced(offset: Array, deflection: Array, segments: Segments, blocks: NDArray[np.intp]) -> FloatArray:
    """Displacement [rad] of what is seen, (…, blocks), for errors of states (…, stops, blocks) [m and 1]."""
    last = np.maximum(offset[..., -1, :] / np.maximum(segments.last[blocks], 1.0), deflection[..., -1, :])
    last[..., segments.buried[blocks]] = 0
    # On to the end of each segment; what is seen there is as far away as it is long.
    start = segments.start[blocks].min(axis=2).T
    end = np.maximum(segments.end[blocks], 1.0).T
    there = (offset[..., :-1, :] + deflection[..., :-1, :] * np.maximum(end - start, 0)) / end
    there[..., np.arange(len(start))[:, None] >= segments.count[blocks]] = 0
    return np.asarray(np.maximum(last, there.max(axis=-2)), dtype=np.float64)
