"""Paths of blocks that are torn: shared in the cells in which they differ smoothly, and in these alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nigemizu.field import Field
from nigemizu.trace.refine import OpenGrid, displaced, fly_nodes
from nigemizu.trace.scout import Segments
from nigemizu.trace.table import RECORD, PathTable, records_of
from nigemizu.trace.view import View

__all__ = ["lay_cellwise"]

Array = NDArray[np.floating[Any]]

_GRIDS: Final = ((16, 16), (8, 16), (8, 8))  # cells of a block, across and down: the first that is worth it
_WORTH: Final = 0.45  # nodes per ray; of blocks that are not laid well enough every ray is marched
_MOST_TORN: Final = 0.75  # of a block's cells; with more of them torn all its rays are marched
_TOGETHER: Final = 1024  # blocks that are worked on at a time


def lay_cellwise(
    field: Field,
    view: View,
    segments: Segments,
    table: PathTable,
    parts: list[OpenGrid],
    *,
    accuracy: float,
    integration: float,
    max_steps: int,
    rays: float,
) -> tuple[PathTable, NDArray[np.intp]]:
    """Lay the paths of blocks that are not smooth as a whole on a grid, and mark its cells that are torn.

    Parameters
    ----------
    field, view, segments, accuracy, integration, max_steps, rays
        As for `nigemizu.trace.refine.refine`.
    table : PathTable
        Of the other blocks.
    parts : list of OpenGrid
        The blocks, with what has been flown of them already.

    Returns
    -------
    PathTable
        With the blocks of which a good part can be shared; the others share nothing.
    (m,) int
        The blocks that have been laid.

    Notes
    -----
    In a cell paths are linear across and down. The error of that is an eighth of the second difference, of
    which the greatest at the cell's corners is taken; a kink within the cell shows there, too.
    """
    grid = next((g for g in _GRIDS if (g[0] + 1) * (g[1] + 1) <= _WORTH * rays), None)
    cells, base, error = table.cells.copy(), table.base.copy(), table.error.copy()
    for part in parts:
        cells[part.blocks] = 0
        error[part.blocks] = 0
    if grid is None or not parts:
        return replace(table, cells=cells, error=error), np.zeros(0, dtype=np.intp)
    kept, laid, size = [table.records], [], len(table.records) // RECORD
    flown, steps = table.flown, table.steps * table.flown
    for part in _portions(parts, grid):
        chosen = part.blocks
        round_ = fly_nodes(field, view, segments, [part], integration, max_steps)
        flown, steps = flown + round_.rays, steps + round_.steps
        states = round_.states[0]
        wrong = _cell_errors(states, segments, chosen)
        torn = ~(wrong <= accuracy)
        good = np.flatnonzero(~round_.lost[0] & (torn.mean(axis=(0, 1)) <= _MOST_TORN))
        records = records_of(states[..., good])
        records[:, 0, :-1, :-1, 3] = torn[..., good].transpose(2, 0, 1)
        per_block = records[0].size // RECORD if len(good) else 0
        members = chosen[good]
        base[members] = size + per_block * np.arange(len(good))
        cells[members] = grid
        error[members] = np.where(torn, 0.0, wrong)[..., good].max(axis=(0, 1))
        kept.append(records.ravel())
        laid.append(members)
        size += per_block * len(good)
    return PathTable(np.concatenate(kept), base, cells, error, steps / max(flown, 1), flown), np.concatenate(
        laid
    )


def _portions(parts: list[OpenGrid], grid: tuple[int, int]) -> Iterator[OpenGrid]:
    """The blocks on the grid, not too many at a time."""
    for part in parts:
        for first in range(0, len(part.blocks), _TOGETHER):
            yield part.part(slice(first, first + _TOGETHER)).refined(grid)


def _cell_errors(states: Array, segments: Segments, blocks: NDArray[np.intp]) -> Array:
    """By how much [rad] linear paths miss in each cell, (rows, columns, blocks)."""
    across, down = (_node_errors(part, segments, blocks) for part in (states.swapaxes(0, 1), states))
    nodes = across.swapaxes(0, 1) + down
    rows = np.maximum(nodes[:-1], nodes[1:])
    return np.asarray(np.maximum(rows[:, :-1], rows[:, 1:]))


def _node_errors(states: Array, segments: Segments, blocks: NDArray[np.intp]) -> Array:
    """An eighth of the second difference down, as a displacement [rad]; at the ends that of the next."""
    squares = np.square((states[2:] + states[:-2] - 2 * states[1:-1]) / 8)
    offset, deflection = (np.sqrt(squares[:, :, :, i : i + 3].sum(axis=3)) for i in (0, 3))
    inside = displaced(offset, deflection, segments, blocks)
    return np.concatenate([inside[:1], inside, inside[-1:]])
