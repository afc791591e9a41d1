"""The tricubic volume, against SciPy's tensor-product spline and by what a spline must do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, NdBSpline, make_interp_spline

from nigemizu import field
from nigemizu.errors import InputError
from nigemizu.field.splines import column_slopes

SINGLE, DOUBLE = field.types("llvm", "single"), field.types("llvm", "double")

EVEN = (np.linspace(-2, 3, 7), np.linspace(-1, 2, 5), np.linspace(0, 4, 10))
STRETCHED = (
    np.array([-2.0, -1.6, -0.4, 0.5, 1.9, 2.2, 3.0]),
    np.array([-1.0, -0.5, 0.5, 1.2, 2.0]),
    np.concatenate([[0.0], np.cumsum(0.05 * 1.4 ** np.arange(9))]),
)


def uneven(nodes: tuple[np.ndarray, ...], seed: int = 3) -> np.ndarray:
    random = np.random.default_rng(seed)
    return 2.7e-4 + 1e-5 * random.standard_normal([len(axis) for axis in reversed(nodes)])


def inside(nodes: tuple[np.ndarray, ...], count: int, seed: int = 5) -> np.ndarray:
    random = np.random.default_rng(seed)
    return random.uniform([axis[0] for axis in nodes], [axis[-1] for axis in nodes], (count, 3))


def oracle(nodes: tuple[np.ndarray, ...], data: np.ndarray, points: np.ndarray) -> list[np.ndarray]:
    """n − 1 and its derivatives in x, y, z by SciPy, with the order that few nodes permit."""
    knots, orders = [], []
    for dimension, axis in enumerate(reversed(nodes)):
        order = min(3, len(axis) - 1)
        if order == 2:  # SciPy puts the knots of parabolas between the nodes; with three there are none
            spline = make_interp_spline(axis, data, k=2, axis=dimension, t=[axis[0]] * 3 + [axis[-1]] * 3)
        else:
            spline = make_interp_spline(axis, data, k=order, axis=dimension)
        data = np.moveaxis(spline.c, 0, dimension)
        knots.append(spline.t)
        orders.append(order)
    spline = NdBSpline(tuple(knots), data, tuple(orders))
    return [spline(points[:, ::-1], nu=nu) for nu in ((0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0))]


@pytest.mark.parametrize("nodes", [EVEN, STRETCHED], ids=["even", "stretched"])
@pytest.mark.parametrize(
    ("types", "value_tolerance", "gradient_tolerance"),
    [(DOUBLE, 1e-15, 1e-16), (SINGLE, 2e-7, 1e-9)],
    ids=["double", "single"],
)
def test_values_and_gradients_are_those_of_scipy(
    types: field.Types, nodes: tuple[np.ndarray, ...], value_tolerance: float, gradient_tolerance: float
) -> None:
    data, points = uneven(nodes), inside(nodes, 1000)
    volume = field.TricubicVolume(*nodes, data, types)
    n, gradient = volume.value_and_gradient(types.Array3f(np.ascontiguousarray(points.T)))
    value, *slopes = oracle(nodes, data, points)
    assert np.max(np.abs(np.array(n) - 1 - value)) < value_tolerance
    assert np.ptp(value) > 2e-5  # the tolerance can see the data
    # the thinnest cell is 5 cm: slopes of up to 1e-3 are the difference of values rounded at 1e-5
    assert np.max(np.abs(np.array(gradient) - np.array(slopes))) < gradient_tolerance
    assert np.max(np.abs(slopes)) > 1e-5
    assert volume.shape == data.shape


@pytest.mark.parametrize("counts", [(2, 3, 4), (3, 2, 5), (2, 2, 2), (3, 4, 3)])
def test_few_nodes_get_the_order_that_they_permit(counts: tuple[int, int, int]) -> None:
    nodes = tuple(axis[:count] for axis, count in zip(STRETCHED, counts, strict=True))
    data, points = uneven(nodes), inside(nodes, 300)
    volume = field.TricubicVolume(*nodes, data, DOUBLE)
    n, gradient = volume.value_and_gradient(DOUBLE.Array3f(np.ascontiguousarray(points.T)))
    value, *slopes = oracle(nodes, data, points)
    assert np.max(np.abs(np.array(n) - 1 - value)) < 1e-15
    assert np.max(np.abs(np.array(gradient) - np.array(slopes))) < 1e-15


@pytest.mark.parametrize("nodes", [EVEN, STRETCHED], ids=["even", "stretched"])
def test_data_at_the_nodes_come_back(nodes: tuple[np.ndarray, ...]) -> None:
    data = uneven(nodes)
    z, y, x = np.meshgrid(*reversed(nodes), indexing="ij")
    n, _ = field.TricubicVolume(*nodes, data, DOUBLE).value_and_gradient(
        DOUBLE.Array3f(x.ravel(), y.ravel(), z.ravel())
    )
    assert np.max(np.abs(np.array(n) - 1 - data.ravel())) < 1e-15


@pytest.mark.parametrize("nodes", [EVEN, STRETCHED], ids=["even", "stretched"])
def test_gradient_is_continuous_across_faces(nodes: tuple[np.ndarray, ...]) -> None:
    data, points = uneven(nodes), inside(nodes, 60)
    smooth = field.TricubicVolume(*nodes, data, DOUBLE)
    kinked = field.TrilinearVolume(*nodes, data, DOUBLE)
    for axis in range(3):
        on_face = points.copy()
        on_face[:, axis] = nodes[axis][1:-1][np.arange(60) % (len(nodes[axis]) - 2)]
        step = np.zeros(3)
        step[axis] = 1e-9
        jumps = []
        for volume in (smooth, kinked):
            sides = [
                np.array(volume.value_and_gradient(DOUBLE.Array3f(np.ascontiguousarray(side.T)))[1])
                for side in (on_face - step, on_face + step)
            ]
            jumps.append(np.max(np.abs(sides[1] - sides[0])))
        assert jumps[0] < 1e-10
        assert jumps[1] > 1e-6


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
@pytest.mark.parametrize("nodes", [EVEN, STRETCHED], ids=["even", "stretched"])
def test_extended_columns_go_on_without_horizontal_gradient(
    types: field.Types, nodes: tuple[np.ndarray, ...]
) -> None:
    x, y, z = nodes
    data = uneven(nodes)
    volume = field.TricubicVolume(*nodes, data, types, beyond="extend")
    beyond = np.array([[500.0, 0.2, 0.4], [-9.0, 0.2, 0.4], [0.3, -70.0, 0.3], [50.0, 70.0, z[-1]]])
    at = np.clip(beyond, [x[0], y[0], z[0]], [x[-1], y[-1], z[-1]])
    value, *slopes = oracle(nodes, data, at)
    expected = np.array(slopes).T
    expected[[0, 1, 3], 0] = 0
    expected[[2, 3], 1] = 0
    points = types.Array3f(np.ascontiguousarray(beyond.T))
    cell = volume.cell(points, types.Array3f(1, -1, -1))
    value_tolerance, tolerance = (1e-15, 1e-15) if types is DOUBLE else (2e-7, 1e-9)
    for n, gradient in (volume.value_and_gradient(points), cell.value_and_gradient(points)):
        assert np.max(np.abs(np.array(n) - 1 - value)) < value_tolerance
        assert np.max(np.abs(np.array(gradient).T - expected)) < tolerance
        assert np.all(np.array(gradient).T[expected == 0] == 0)
    lower, upper = np.array(cell.lower).T, np.array(cell.upper).T
    # Uneven air goes on for 20 km.
    west, east, south, north = x[0] - 20e3, x[-1] + 20e3, y[0] - 20e3, y[-1] + 20e3
    assert np.allclose(upper[:, 0], [east, x[0], upper[2, 0], east], rtol=1e-7)
    assert np.allclose(lower[[0, 1, 3], 0], [x[-1], west, x[-1]], rtol=1e-7)
    assert np.allclose([lower[2, 1], upper[3, 1]], [south, north], rtol=1e-7)


def test_air_that_is_only_stratified_needs_no_taps() -> None:
    nodes = STRETCHED
    profile = uneven(nodes)[:, :1, :1]
    data = np.broadcast_to(profile, [len(axis) for axis in reversed(nodes)])
    volume = field.TricubicVolume(*nodes, data, DOUBLE, beyond="extend")
    assert volume.stratified
    assert not field.TricubicVolume(*nodes, uneven(nodes), DOUBLE, beyond="extend").stratified
    points = inside(nodes, 200)
    n, gradient = volume.value_and_gradient(DOUBLE.Array3f(np.ascontiguousarray(points.T)))
    column = profile[:, 0, 0]
    spline = CubicHermiteSpline(nodes[2], column, column_slopes(nodes[2], column))
    assert np.max(np.abs(np.array(n) - 1 - spline(points[:, 2]))) < 1e-15
    assert np.max(np.abs(np.array(gradient.z) - spline(points[:, 2], nu=1))) < 1e-16


def test_bad_data_is_refused() -> None:
    axis = [0.0, 1.0]
    with pytest.raises(InputError, match="does not fit the axes"):
        field.TricubicVolume([0, 1, 2], axis, axis, np.zeros((2, 2, 2)), DOUBLE)
    with pytest.raises(InputError, match="at least two nodes"):
        field.TricubicVolume(axis, [0.0], axis, np.arange(4.0).reshape(2, 1, 2), DOUBLE)
    with pytest.raises(InputError, match="expected straight, extend or mean"):
        field.TricubicVolume(axis, axis, axis, np.zeros((2, 2, 2)), DOUBLE, beyond="wrap")  # type: ignore[arg-type]
