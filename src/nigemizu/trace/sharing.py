"""Laying the paths that the rays of a picture share."""

from __future__ import annotations

from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nigemizu.field import Bottomless, BoxedField, Field, Types
from nigemizu.trace.cellwise import lay_cellwise
from nigemizu.trace.refine import OpenGrid, refine
from nigemizu.trace.scout import BLOCK, Segments, scout
from nigemizu.trace.shared import INTEGRATION, SharedPaths
from nigemizu.trace.stations import fly_places
from nigemizu.trace.table import PathTable
from nigemizu.trace.view import View, spread

__all__ = ["grounded", "share_paths"]

_SHARING: Final = 0.7  # of the accuracy that sharing may use up
_FAR: Final = 0.5  # of the median exit: blocks that are left sooner are not tested either
_QUIET: Final = 0.02  # of the accuracy: blocks whose error is estimated smaller are not tested
_PASSED: Final = 0.5  # of the accuracy, that the rays tested may be wrong by: others in the block are more so
_PASSED_CELLWISE: Final = 1.0  # the same where what is not smooth has been marked
_TESTS: Final = (12, 512, 24576)  # rays in each of the others: at least, at most, and in all of them together
_END_OF_GROUND: Final = 1e5  # m


def share_paths(
    field: Field,
    view: View,
    boxes: NDArray[np.float64],
    *,
    accuracy: float,
    max_steps: int,
    rays: float = 16.0,
    types: Types | None = None,
) -> SharedPaths:
    """Build the table of paths for the rays of one eye.

    Parameters
    ----------
    field : Field
        In double precision where the table shall be.
    view : View
    boxes : (N, 2, 3) float64, m
        Boxes that together contain every surface (none: nothing can be hit).
    accuracy : float, rad
        Displacement, seen from the eye, that bending and sharing may add.
    max_steps : int
        Most intervals per path.
    rays : float
        Rays per pixel that will use the table.
    types : Types, optional
        Array types of the rays that will use the table; by default those of the field.

    Returns
    -------
    SharedPaths
    """
    farthest = _farthest(field, view, boxes)
    deepened = grounded(field, boxes)
    floor = field.lower[2] if isinstance(field, BoxedField) and deepened is not field else -np.inf
    field = deepened
    integration = accuracy * INTEGRATION
    segments = scout(
        field, view, boxes, accuracy=integration, max_steps=max_steps, farthest=farthest, floor=floor
    )
    options: dict[str, Any] = {
        "accuracy": accuracy * _SHARING,
        "integration": integration,
        "max_steps": max_steps,
        "rays": rays * BLOCK[0] * BLOCK[1],
    }
    table, rough = refine(field, view, segments, **options)
    test = partial(
        _wrong_places,
        field,
        view,
        segments,
        integration=integration,
        max_steps=max_steps,
        floor=floor,
    )
    types = types or field.types
    paths = SharedPaths(types, view, segments, table)
    wrong, _ = test(paths, _doubtful(table, segments, accuracy), passed=_PASSED * accuracy)
    wrong = np.unique(wrong)
    if len(wrong):
        rough.append(OpenGrid(BLOCK, wrong, None, (1, 1)))
    if not rough:
        return paths
    table, laid = lay_cellwise(field, view, segments, table, rough, **options)
    paths = SharedPaths(types, view, segments, table)
    wrong, across = test(paths, laid, passed=_PASSED_CELLWISE * accuracy)
    return SharedPaths(types, view, segments, table.torn_at(wrong, across)) if len(wrong) else paths


def _doubtful(table: PathTable, segments: Segments, accuracy: float) -> NDArray[np.intp]:
    """Shared blocks that are worth a test."""
    far = segments.last > _FAR * np.median(segments.last)
    return np.flatnonzero((table.cells[:, 0] > 0) & ((table.error > _QUIET * accuracy) | far))


def _wrong_places(
    field: Field,
    view: View,
    segments: Segments,
    paths: SharedPaths,
    blocks: NDArray[np.intp],
    *,
    passed: float,
    integration: float,
    max_steps: int,
    floor: float,
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Where a few rays between the nodes, flown for the purpose, differ from the table by more than `passed`
    [rad]: in which of the blocks, and how far across it (0 to 1).

    What the grids' own comparison cannot see: a kink between two nodes.
    """
    if not len(blocks):
        return blocks, np.zeros(0)
    row, column = np.divmod(blocks, segments.columns)
    fewest, most, together = _TESTS
    count = max(fewest, min(most, together // len(blocks)))
    u, v = spread(count)
    x, y = ((column + u[:, None]) * BLOCK[0]).ravel(), ((row + v[:, None]) * BLOCK[1]).ravel()
    lengths = np.tile(segments.last[blocks], count)[None]
    flown = fly_places(field, view, x, y, lengths, integration, max_steps)
    states = flown.states[:, 0].astype(np.float64)
    interpolated, shared = paths.last_states(view.rays(paths.types, x, y)[1])
    wrong = np.abs(states - interpolated)
    offset, deflection = (np.linalg.norm(wrong[i : i + 3], axis=0) for i in (0, 3))
    displaced = np.maximum(offset / np.maximum(lengths[0], 1.0), deflection)
    # A ray that is bent further on than the corners of its block is no part of the table either. One that
    # has been below the ground has met it.
    ends = flown.lowest < floor
    displaced[~flown.outside & ~ends] = np.inf
    displaced[ends | ~shared] = 0
    test, number = np.nonzero(displaced.reshape(count, -1) > passed)
    return blocks[number], u[test]


def _farthest(field: Field, view: View, boxes: NDArray[np.float64]) -> float:
    """Path length [m] within which every object and every bounded side of the volume lies."""
    corners = [np.abs(boxes.reshape(-1, 3) - view.eye).max(axis=0)] if len(boxes) else []
    for bound in (getattr(field, "lower", None), getattr(field, "upper", None)):
        if bound is not None:
            about = np.abs(np.asarray(bound) - view.eye)
            corners.append(np.where(np.isfinite(about), about, 0.0))
    reach = float(np.linalg.norm(np.max(corners, axis=0))) if corners else 0.0
    return max(reach, 10.0) * 1.01


def grounded(field: Field, boxes: NDArray[np.float64]) -> Field:
    """The field, continued below its floor (`nigemizu.field.Bottomless`) where a flat ground covers that.

    Parameters
    ----------
    field : Field
    boxes : (N, 2, 3) float64, m
        As for `share_paths`.
    """
    return Bottomless(field) if isinstance(field, BoxedField) and _is_covered(field, boxes) else field


def _is_covered(field: BoxedField, boxes: NDArray[np.float64]) -> bool:
    """Whether a flat ground lies on the floor of the volume, so that no light leaves it there."""
    lower, upper = np.asarray(field.lower), np.asarray(field.upper)
    if not np.isfinite(lower[2]) or not len(boxes):
        return False
    # Without sides the air ends where the ground of the picture does.
    west, east = np.maximum(lower[:2], -_END_OF_GROUND), np.minimum(upper[:2], _END_OF_GROUND)
    flat = np.all(np.abs(boxes[:, :, 2] - lower[2]) < 1e-3, axis=1)
    wide = np.all((boxes[:, 0, :2] <= west) & (boxes[:, 1, :2] >= east), axis=1)
    return bool(np.any(flat & wide))
