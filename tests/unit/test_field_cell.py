"""Cells: the formula of each is the field's own, and walking from cell to cell leaves none out."""

from __future__ import annotations

import itertools

import drjit as dr
import numpy as np
import pytest

from nigemizu import field

SINGLE, DOUBLE = field.types("llvm", "single"), field.types("llvm", "double")
BOTH = pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])

EVEN = (np.linspace(-2, 3, 11), np.linspace(-1, 2, 7), np.linspace(0, 4, 17))
STRETCHED = (
    np.array([-2.0, -1.6, -0.4, 0.5, 1.9, 2.2, 3.0]),
    np.array([-1.0, -0.5, 0.5, 1.2, 2.0]),
    np.concatenate([[0.0], np.cumsum(0.02 * 1.3 ** np.arange(14))]),
)
MESHES = pytest.mark.parametrize("nodes", [EVEN, STRETCHED], ids=["even", "stretched"])


def uneven(nodes: tuple[np.ndarray, ...], seed: int = 3) -> np.ndarray:
    random = np.random.default_rng(seed)
    z = nodes[2][:, None, None]
    shape = [len(axis) for axis in reversed(nodes)]
    return 2.7e-4 - 2e-5 * np.exp(-z / 0.5) + 1e-5 * random.standard_normal(shape)


def volumes(nodes: tuple[np.ndarray, ...], types: field.Types) -> list[field.Field]:
    data = uneven(nodes)
    return [
        *(
            field.TrilinearVolume(*nodes, data, types, beyond, background=background)
            for beyond, background in itertools.product(("straight", "extend"), ("linear", "profile"))
        ),
        field.TricubicVolume(*nodes, data, types),
        field.TricubicVolume(*nodes, data, types, beyond="extend"),
        field.StratifiedVolume(*nodes, data, types),
        field.StratifiedVolume(*nodes, data, types, beyond="extend"),
    ]


def array(values: object, types: field.Types = DOUBLE) -> object:
    return types.Array3f(np.ascontiguousarray(np.asarray(values).T))


def rows(values: object, count: int) -> np.ndarray:
    return np.broadcast_to(np.array(values), (3, count)).T


def clear_points(
    nodes: tuple[np.ndarray, ...], count: int, margin: float = 0.0, seed: int = 5
) -> tuple[np.ndarray, np.ndarray]:
    """Random points, up to `margin` beyond the sides, well away from all faces; random directions."""
    random = np.random.default_rng(seed)
    wider = np.array([margin, margin, 0])
    lower = np.array([axis[0] for axis in nodes]) - wider
    upper = np.array([axis[-1] for axis in nodes]) + wider
    points = random.uniform(lower, upper, (count, 3))
    near = [np.min(np.abs(points[:, [a]] - nodes[a]), axis=1) for a in range(3)]
    return points[np.min(near, axis=0) > 1e-3], random.standard_normal((count, 3))


def box(nodes: tuple[np.ndarray, ...], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the cells by NumPy; beyond the nodes they reach to infinity."""
    bounds = []
    for number, axis in enumerate(nodes):
        edges = np.concatenate([[-np.inf], axis, [np.inf]])
        index = np.searchsorted(edges, points[:, number], side="right") - 1
        bounds.append((edges[index], edges[index + 1]))
    lower, upper = np.transpose(bounds, (1, 2, 0))
    return lower, upper


@BOTH
@MESHES
def test_the_formula_of_a_cell_is_the_field_in_its_box(
    types: field.Types, nodes: tuple[np.ndarray, ...]
) -> None:
    for volume in volumes(nodes, types):
        extended = not np.isfinite(volume.lower[0])  # type: ignore[attr-defined]
        points, directions = clear_points(nodes, 1500, margin=2.0 if extended else 0.0)
        position = array(points, types)
        cell = volume.cell(position, array(directions[: len(points)], types))
        n, gradient = volume.value_and_gradient(position)
        cell_n, cell_gradient = cell.value_and_gradient(position)
        digits = (3e-7, 2e-8) if types is SINGLE else (1e-15, 1e-15)
        assert np.max(np.abs(np.array(n) - np.array(cell_n))) < digits[0]
        assert np.max(np.abs(np.array(gradient) - np.array(cell_gradient))) < digits[1]
        assert np.max(np.abs(np.array(gradient))) > 1e-5
        lower, upper = box(nodes, points)
        assert np.allclose(rows(cell.lower, len(points)), lower, rtol=1e-6, atol=1e-6)
        assert np.allclose(rows(cell.upper, len(points)), upper, rtol=1e-6, atol=1e-6)
        assert cell.reach is None


@MESHES
def test_cells_join_at_their_faces(nodes: tuple[np.ndarray, ...]) -> None:
    """Both cells at a face say the same there, of n and of the gradient along the face."""
    points, _ = clear_points(nodes, 400)
    for volume in volumes(nodes, DOUBLE):
        for axis in range(3):
            on_face = points.copy()
            on_face[:, axis] = nodes[axis][1:-1][np.arange(len(points)) % (len(nodes[axis]) - 2)]
            ahead = np.zeros(3)
            ahead[axis] = 1.0
            position = array(on_face)
            before, behind = (volume.cell(position, array(d * np.ones((1, 3)))) for d in (-ahead, ahead))
            assert np.array_equal(np.array(before.upper)[axis], on_face[:, axis])
            assert np.array_equal(np.array(behind.lower)[axis], on_face[:, axis])
            (n0, g0), (n1, g1) = before.value_and_gradient(position), behind.value_and_gradient(position)
            assert np.max(np.abs(np.array(n0) - np.array(n1))) < 1e-15
            along = [other for other in range(3) if other != axis]
            assert np.max(np.abs(np.array(g0) - np.array(g1))[along]) < 1e-15


@BOTH
@pytest.mark.parametrize("number", [0, 2], ids=["even", "stretched"])
def test_the_cell_ahead_is_taken(types: field.Types, number: int) -> None:
    axis = (EVEN if number == 0 else STRETCHED)[2]
    volume = field.TrilinearVolume(EVEN[0], EVEN[1], axis, uneven((*EVEN[:2], axis)), types)
    dtype = np.float32 if types is SINGLE else np.float64
    nodes = axis.astype(dtype)
    close = dtype(5e-5) * (axis[1] - axis[0]).astype(dtype)
    for way, offset in itertools.product((-1.0, 0.0, 1.0), (-close, 0, close)):
        z = nodes + offset
        position = types.Array3f(types.Float(0.3), types.Float(0.3), types.Float(z))
        cell = volume.cell(position, types.Array3f(1, 1, way))
        index = np.searchsorted(nodes, z, side="right") - 1
        if way:
            index = np.arange(len(nodes)) - (way < 0)
        index = np.clip(index, 0, len(nodes) - 2)
        assert np.allclose(np.array(cell.lower)[2], nodes[index], rtol=0, atol=1e-6)
        assert np.allclose(np.array(cell.upper)[2], nodes[index + 1], rtol=0, atol=1e-6)
    # Farther from a face than rounding, the cell is the one that holds the position.
    z = nodes[1:-1] - 1e-3 * (axis[1] - axis[0])
    position = types.Array3f(types.Float(0.3), types.Float(0.3), types.Float(z))
    cell = volume.cell(position, types.Array3f(0, 0, 1))
    assert np.allclose(np.array(cell.upper)[2], nodes[1:-1], rtol=0, atol=1e-6)


@BOTH
def test_outside_extended_columns_lie_cells_of_20_km(types: field.Types) -> None:
    volume = field.TrilinearVolume(*STRETCHED, uneven(STRETCHED), types, "extend")
    x = STRETCHED[0]
    points = types.Array3f([x[0], x[0], x[-1], x[-1]], [0.2] * 4, [0.3] * 4)
    cell = volume.cell(points, types.Array3f([-1, 1, 1, -1], 0, 0))
    first, last = x[[1, -2]].astype(np.float32)
    west, east = x[0] - 20e3, x[-1] + 20e3
    assert np.allclose(np.array(cell.lower)[0], [west, x[0], x[-1], last], rtol=1e-7)
    assert np.allclose(np.array(cell.upper)[0], [x[0], first, east, x[-1]], rtol=1e-7)
    assert np.allclose(cell.exit(points, types.Array3f([-1, 1, 1, -1], 0, 0))[0], 20e3, rtol=1e-7)


def crossed(
    nodes: tuple[np.ndarray, ...], start: np.ndarray, d: np.ndarray
) -> list[tuple[tuple[int, ...], bool]]:
    """Cells along a line, by brute force: the middles between all its crossings of all faces.

    With each cell goes whether it is more than the sliver beside an edge that a ray may skip.
    """
    lines = list(zip(nodes, start, d, strict=True))
    leave = min(float(np.max((axis[[0, -1]] - o) / v)) for axis, o, v in lines)
    times = [(axis - o) / v for axis, o, v in lines]
    edges = np.unique(np.concatenate([[0, leave], *(t[(t > 0) & (t < leave)] for t in times)]))
    middles = start + 0.5 * (edges[1:] + edges[:-1])[:, None] * d
    cells = np.transpose([np.searchsorted(axis, middles[:, a]) - 1 for a, axis in enumerate(nodes)])
    thinnest = max(np.diff(axis).min() for axis in nodes)
    solid = np.diff(edges) * np.abs(d).min() > 2e-4 * thinnest
    return list(zip(map(tuple, cells.tolist()), solid.tolist(), strict=True))


@BOTH
@MESHES
def test_walking_from_cell_to_cell_leaves_none_out(types: field.Types, nodes: tuple[np.ndarray, ...]) -> None:
    count = 200
    random = np.random.default_rng(17)
    start = random.uniform([axis[0] for axis in nodes], [axis[-1] for axis in nodes], (count, 3))
    ahead = random.standard_normal((count, 3))
    start, ahead = (values.astype(np.float32).astype(float) for values in (start, ahead))
    volume = field.TrilinearVolume(*nodes, uneven(nodes), types)
    expected = [crossed(nodes, *line) for line in zip(start, ahead, strict=True)]
    position, direction = array(start, types), array(ahead, types)
    visited: list[list[tuple[int, ...]]] = [[] for _ in range(count)]
    for _ in range(max(map(len, expected)) + 1):
        cell = volume.cell(position, direction)
        length = cell.exit(position, direction)
        middle = 0.5 * (rows(cell.lower, count) + rows(cell.upper, count))
        index = np.transpose([np.searchsorted(axis, middle[:, a]) - 1 for a, axis in enumerate(nodes)])
        for ray, way in enumerate(np.array(length)):
            # At the outer face rounding may leave a ray a last bit of way in the same cell.
            if way > 0 and visited[ray][-1:] != [tuple(index[ray].tolist())]:
                visited[ray].append(tuple(index[ray].tolist()))
        position = position + direction * length
        dr.eval(position)
    wrong = 0
    for seen, cells in zip(visited, expected, strict=True):
        order = [cells.index(entry) for entry in cells if entry[0] in seen]
        passed = [cells[number][0] for number in order]
        left_out = [one for one, solid in cells if solid and one not in seen]
        wrong += bool(left_out) or seen != passed
    # In single precision a line may pass an edge on its other side.
    assert wrong <= (2 if types is SINGLE else 0)
    assert sum(map(len, expected)) > 5 * count
    assert np.mean([solid for cells in expected for _, solid in cells]) > 0.95
    # All rays have arrived: nowhere is there any way left to go.
    assert np.max(np.array(length)) < 1e-4


@pytest.mark.parametrize("beyond", ["straight", "extend"])
@pytest.mark.parametrize("background", ["linear", "profile"])
@BOTH
@MESHES
def test_quiet_blocks_keep_their_promise(
    types: field.Types, nodes: tuple[np.ndarray, ...], background: str, beyond: str
) -> None:
    """Smooth air over a finer mesh: whole blocks are given, and the gradient is right to `flatness`."""
    x, y, z = (np.interp(np.linspace(0, len(a) - 1, 4 * len(a)), np.arange(len(a)), a) for a in nodes)
    bump = np.exp(-((x / 0.4) ** 2) - ((y[:, None] / 0.4) ** 2)) * np.exp(-z / 0.3)[:, None, None]
    data = 2.7e-4 - 2e-5 * np.exp(-z / 0.5)[:, None, None] + 1e-6 * bump
    points, directions = clear_points((x, y, z), 3000, margin=1.0 if beyond == "extend" else 0.0)
    position, ahead = array(points, types), array(directions[: len(points)], types)
    flatness = 5e-7
    quiet = field.TrilinearVolume(x, y, z, data, types, beyond, background=background, flatness=flatness)
    plain = field.TrilinearVolume(x, y, z, data, types, beyond, background=background)
    n, gradient = quiet.value_and_gradient(position)
    assert np.array_equal(np.array(n), np.array(plain.value_and_gradient(position)[0]))
    cell, small = quiet.cell(position, ahead), plain.cell(position, ahead)
    errors = np.max(np.abs(np.array(cell.value_and_gradient(position)[1]) - np.array(gradient)), axis=0)
    assert np.max(errors) <= flatness
    assert np.mean(errors > 1e-3 * flatness) > 0.05  # blocks are used, and are not exact
    size, cell_size = (rows(c.upper, len(points)) - rows(c.lower, len(points)) for c in (cell, small))
    bounded = np.all(cell_size < 10e3, axis=1)  # not the extended columns
    times = size[bounded] / cell_size[bounded]
    assert np.min(times) > 0.999
    assert np.mean(times[:, 0] > 3) > (0.4 if background == "profile" else 0.1)
    assert np.any(np.max(times, axis=1) < 1.001)  # where the air is not quiet
    low, high = rows(cell.lower, len(points)), rows(cell.upper, len(points))
    assert np.all((points > low - 1e-6) & (points < high + 1e-6))


def test_blocks_without_deviation_are_quiet_by_themselves() -> None:
    x, y, z = (np.linspace(0, 16, 17),) * 3
    data = np.full((17, 17, 17), 2.7e-4)
    data[2, 3, 4] += 1e-6
    volume = field.TrilinearVolume(x, y, z, data, DOUBLE, background="profile")
    points = array([[10.5, 10.5, 10.5], [4.5, 3.5, 2.5], [4.5, 3.5, 6.5]])
    cell = volume.cell(points, DOUBLE.Array3f(1, 1, 1))
    assert np.array_equal(np.array(cell.lower)[:2], [[8, 4, 4], [8, 3, 0]])
    assert np.array_equal(np.array(cell.upper)[:2], [[12, 5, 8], [12, 4, 4]])
    n, gradient = cell.value_and_gradient(points)
    exact_n, exact_gradient = volume.value_and_gradient(points)
    assert np.max(np.abs(np.array(gradient) - np.array(exact_gradient))) < 1e-20
    assert np.max(np.abs(np.array(n) - np.array(exact_n))) < 1e-15
