"""Boxes around what stands in a scene: where light can meet a surface at all."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError

__all__ = ["object_boxes"]

Boxes = NDArray[np.floating[Any]]
Indices = NDArray[np.int64]
# Of putting boxes together: summed measures of the parts (N, 2), those of the boxes around them -> (N,)
Cost = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]

# Boxes are kept apart where that leaves less than this part of (volume × area) of the box around them.
_WORTH: Final = 0.7
# Cuts in a row that may bring nothing: a ring falls into smaller boxes only at the third.
_PATIENCE: Final = 3
_MARGIN: Final = 1e-6  # of the largest coordinate: eight units of single precision
_EMPTY: Final = 0.1  # what the parts may leave of a box that is cut however long that brings nothing
_CELLS: Final = 600  # clusters of triangles that an object is cut between
_CROWD: Final = 1000  # shapes that are compared with each other; of more, neighbours go together first
_LAYERS: Final = (32, 16, 10, 7, 5, 3)  # per axis, tried in turn
_DRAWN: Final = 4096  # centres that the cells are measured by


def object_boxes(scene: Any, *, most: int = 512) -> NDArray[np.float64]:
    """Boxes along the axes which together contain every surface of a scene.

    Parameters
    ----------
    scene : mi.Scene
        From `build`, or loaded by Mitsuba.
    most : int
        Most boxes.

    Returns
    -------
    (N, 2, 3) float64, scene units
        Lower and upper corners, N ≤ `most`; a flat ground is one box without height. N = 0 for a scene
        without surfaces.

    Raises
    ------
    InputError
        If `most` is less than one.

    Notes
    -----
    Shapes share a box where that encloses hardly more than their own boxes (the parts of a car). The
    triangles of what is left are cut into two clusters, in the order of their centres along an axis or of
    their sizes, and these again, as long as Σ V/V₀ · Σ A/A₀ < 0.7 with volume V and area A of the boxes
    before (0) and after. Boxes are widened by 10⁻⁶ of their largest coordinate along each axis.

    Limits: the boxes hold the surfaces as they are now; other shapes than meshes, and instances, are held
    by Mitsuba's own bounding boxes. Where `most` is less than the number of shapes, boxes hold much that
    is empty. A point where a ray met a surface can lie beside the box by the rounding of the ray's length.
    """
    if most < 1:
        raise InputError("at least one box is needed", key="most", value=most)
    bounded = [(shape, shape.bbox()) for shape in scene.shapes()]
    shapes = [shape for shape, bounds in bounded if bounds.valid()]
    corners = [[*bounds.min, *bounds.max] for _, bounds in bounded if bounds.valid()]
    boxes = np.array(corners, dtype=np.float64).reshape(-1, 2, 3)
    groups = _grouped(boxes, most)
    found = [_around(boxes[group]) for group in groups]
    parts = [_parts([shapes[index] for index in group], boxes[group]) for group in groups]
    hollow = [index for index, part in enumerate(parts) if _patience(part, found[index])]
    # What is left of the number goes to the objects that gain by it, more to the larger ones.
    size = np.array([np.sqrt(np.linalg.norm(found[index][1] - found[index][0])) for index in hollow])
    shares = 1 + np.floor((most - len(groups)) * size / max(size.sum(), 1e-300)).astype(np.int64)
    for index, share in zip(hollow, shares, strict=True):
        found[index] = _cut_up(parts[index], int(share))
    tight = np.concatenate([np.zeros((0, 2, 3)), *[np.reshape(box, (-1, 2, 3)) for box in found]])
    margin = _MARGIN * np.abs(tight).max(axis=1, initial=0.0)
    return np.stack([tight[:, 0] - margin, tight[:, 1] + margin], axis=1)


# ---------------------- boxes and their measures ----------------------


def _around(boxes: Boxes) -> NDArray[np.float64]:
    """The box (2, 3) around boxes (N, 2, 3)."""
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]).astype(np.float64)


def _measures(lower: Boxes, upper: Boxes) -> NDArray[np.float64]:
    """Volume and surface area (..., 2) of boxes with corners (..., 3)."""
    size = upper - lower
    a, b, c = size[..., 0], size[..., 1], size[..., 2]
    measures = np.empty((*a.shape, 2))
    measures[..., 0] = a * b * c
    measures[..., 1] = 2 * (a * b + b * c + c * a)
    return measures


def _remainder(parts: NDArray[np.float64], whole: NDArray[np.float64]) -> NDArray[np.float64]:
    """Σ V/V₀ · Σ A/A₀ of summed measures (..., 2); what is flat or a line counts as filled."""
    filled = whole <= 0
    ratio = np.where(filled, 1.0, parts) / np.where(filled, 1.0, whole)
    return np.asarray(ratio[..., 0] * ratio[..., 1])


def _patience(parts: Boxes, box: NDArray[np.float64]) -> float:
    """How many cuts in a row may bring nothing, by how much of the box its parts leave empty."""
    filled = _measures(parts[:, 0], parts[:, 1]).sum(axis=0)
    whole = _measures(box[0], box[1])
    if len(parts) < 2 or np.all(filled >= _WORTH * whole):
        return 0
    return np.inf if _remainder(filled, whole) < _EMPTY else _PATIENCE


# ---------------------- shapes that share a box ----------------------


def _grouped(boxes: Boxes, most: int) -> list[Indices]:
    """Indices of the boxes that share one: first where it costs next to nothing, then down to `most`."""
    groups = [np.array([index]) for index in range(len(boxes))]
    if len(boxes) > _CROWD:
        order, starts = _cells(boxes, _CROWD)
        groups = np.split(order, starts[1:])

    groups = _merged(boxes, groups, lambda parts, whole: -_remainder(parts, whole), limit=-_WORTH, most=1)
    return _merged(boxes, groups, lambda parts, whole: whole[:, 0] - parts[:, 0], limit=np.inf, most=most)


def _merged(boxes: Boxes, groups: list[Indices], cost: Cost, *, limit: float, most: int) -> list[Indices]:
    """Put the two cheapest groups together while their cost is below `limit` and there are over `most`."""
    hulls = np.array([_around(boxes[group]) for group in groups]).reshape(-1, 2, 3)
    apart = np.ones(len(groups), dtype=np.bool_)

    def costs(index: int) -> NDArray[np.float64]:
        """Cost of putting a group together with each other one."""
        lower = np.minimum(hulls[index, 0], hulls[:, 0])
        upper = np.maximum(hulls[index, 1], hulls[:, 1])
        parts = measures + measures[index]
        row = np.where(apart, cost(parts, _measures(lower, upper)), np.inf)
        row[index] = np.inf
        return row

    measures = _measures(hulls[:, 0], hulls[:, 1])
    table = np.array([costs(index) for index in range(len(groups))])
    while apart.sum() > most:
        kept, gone = (int(index) for index in np.unravel_index(np.argmin(table), table.shape))
        if not table[kept, gone] < limit:
            break
        hulls[kept] = _around(hulls[[kept, gone]])
        measures[kept] = _measures(hulls[kept, 0], hulls[kept, 1])
        groups[kept] = np.concatenate([groups[kept], groups[gone]])
        apart[gone] = False
        table[gone], table[:, gone] = np.inf, np.inf
        table[kept] = table[:, kept] = costs(kept)
    return [group for group, alone in zip(groups, apart, strict=True) if alone]


# ---------------------- triangles ----------------------


def _parts(shapes: list[Any], boxes: Boxes) -> Boxes:
    """Boxes (N, 2, 3) around clusters of the triangles of meshes, and around other shapes."""
    found: list[Boxes] = []
    for shape, box in zip(shapes, boxes, strict=True):
        found.append(_triangles(shape) if shape.is_mesh() and shape.face_count() else box[None])
    parts = np.concatenate(found)
    order, starts = _cells(parts, _CELLS)
    lower = np.minimum.reduceat(parts[order, 0], starts, axis=0)
    upper = np.maximum.reduceat(parts[order, 1], starts, axis=0)
    return np.stack([lower, upper], axis=1).astype(np.float64)


def _triangles(mesh: Any) -> Boxes:
    """Boxes (M, 2, 3) float32 of the triangles of a mesh."""
    vertices = np.asarray(mesh.vertex_positions_buffer().numpy()).reshape(-1, 3)
    faces = np.asarray(mesh.faces_buffer().numpy()).reshape(-1, 3)
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return np.stack([np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)], axis=1)


def _cells(boxes: Boxes, most: int) -> tuple[Indices, Indices]:
    """Sort boxes into some `most` cells of neighbours of like size: an order, and where each cell begins.

    Along each axis about equally many centres fall into each layer; sizes within a factor of four go
    together, so that a ground and the house on it do not.
    """
    size = np.frexp(np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1))[1] // 2
    centres = boxes[:, 0] + boxes[:, 1]
    drawn = slice(None, None, max(1, len(boxes) // _DRAWN))
    for layers in _LAYERS:
        bounds = np.quantile(centres[drawn], np.linspace(0, 1, layers + 1)[1:-1], axis=0)
        if len(np.unique(_codes(size[drawn], centres[drawn], bounds))) <= most:
            break
    codes = _codes(size, centres, bounds)
    order = np.argsort(codes, kind="stable")
    codes = codes[order]
    return order, np.flatnonzero(np.concatenate([[True], codes[1:] != codes[:-1]]))


def _codes(size: Any, centres: Boxes, bounds: Boxes) -> Indices:
    """The number of the cell (N,) of sizes (N,) and centres (N, 3) between the layers' bounds (L − 1, 3)."""
    codes = size.astype(np.int64)
    for axis in range(3):
        layer = np.searchsorted(bounds[:, axis], centres[:, axis], side="right")
        codes = codes * (len(bounds) + 1) + layer
    return np.asarray(codes)


# ---------------------- one object into several boxes ----------------------


@final
@dataclass
class _Cluster:
    """A node of the tree that an object is cut into."""

    parts: Boxes
    box: NDArray[np.float64]
    misses: int  # cuts in a row above it that brought nothing
    halves: tuple[_Cluster, _Cluster] | None = None


def _cut_up(parts: Boxes, most: int) -> NDArray[np.float64]:
    """At most `most` boxes (N, 2, 3) around the parts: cuts the largest, then undoes what brought little."""
    root = _Cluster(parts, _around(parts), 0)
    nodes, queue, leaves = [root], [(0.0, 0)], 1
    while queue and leaves < most:
        node = nodes[heapq.heappop(queue)[1]]
        if node.misses >= _patience(node.parts, node.box):
            continue
        first, second, remainder = _cut(node.parts)
        misses = 0 if remainder < _WORTH else node.misses + 1
        node.halves = (_Cluster(first, _around(first), misses), _Cluster(second, _around(second), misses))
        leaves += 1
        for half in node.halves:
            area = _measures(half.box[0], half.box[1])[1]
            heapq.heappush(queue, (-float(area), len(nodes)))
            nodes.append(half)
    return _pruned(root)


def _pruned(node: _Cluster) -> NDArray[np.float64]:
    """The boxes below a node, or its own where they leave too much of it."""
    if node.halves is None:
        return node.box[None]
    below = np.concatenate([_pruned(half) for half in node.halves])
    left = _measures(below[:, 0], below[:, 1]).sum(axis=0)
    return below if _remainder(left, _measures(node.box[0], node.box[1])) < _WORTH else node.box[None]


def _cut(parts: Boxes) -> tuple[Boxes, Boxes, float]:
    """Parts in two clusters, and what their boxes leave of the box around all."""
    box = _around(parts)
    whole = _measures(box[0], box[1])
    centres = (parts[:, 0] + parts[:, 1]) / 2
    keys = np.column_stack([centres, np.linalg.norm(parts[:, 1] - parts[:, 0], axis=1)])
    order = np.argsort(keys, axis=0, kind="stable")
    lower, upper = parts[order, 0], parts[order, 1]
    before = _measures(np.minimum.accumulate(lower), np.maximum.accumulate(upper))
    after = _measures(np.minimum.accumulate(lower[::-1]), np.maximum.accumulate(upper[::-1]))[::-1]
    left = _remainder(before[:-1] + after[1:], whole)
    place, key = np.unravel_index(np.argmin(left), left.shape)
    best, first = float(left[place, key]), int(place) + 1
    if best >= _WORTH:
        # No single cut pays; halves along the longest axis may be worth cutting again.
        key, first = np.argmax(np.ptp(centres, axis=0)), len(parts) // 2
    chosen = order[:, key]
    return parts[chosen[:first]], parts[chosen[first:]], best
