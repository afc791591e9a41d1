"""The volume with a spline in every column, against SciPy and by what such a volume must do."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, RegularGridInterpolator

from nigemizu import field
from nigemizu.errors import InputError
from nigemizu.field.splines import column_slopes

SINGLE, DOUBLE = field.types("llvm", "single"), field.types("llvm", "double")
BOTH = pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])

X = np.linspace(-2, 3, 7)
Y = np.array([-1.0, -0.5, 0.5, 2.0])
EVEN = np.linspace(0, 2, 21)
STRETCHED = np.concatenate([[0.0], np.cumsum(0.02 * 1.25 ** np.arange(14))])
HEIGHTS = pytest.mark.parametrize("z", [EVEN, STRETCHED], ids=["even", "stretched"])


def profile(z: np.ndarray) -> np.ndarray:
    return 2.7e-4 - 2e-5 * np.exp(-z / 0.3)


def uneven(z: np.ndarray) -> np.ndarray:
    random = np.random.default_rng(4)
    return profile(z)[:, None, None] + 1e-6 * random.standard_normal((len(z), len(Y), len(X)))


def inside(z: np.ndarray, count: int = 500) -> np.ndarray:
    random = np.random.default_rng(5)
    return random.uniform([X[0], Y[0], z[0]], [X[-1], Y[-1], z[-1]], (count, 3))


def look_up(volume: field.Field, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    n, gradient = volume.value_and_gradient(volume.types.Array3f(np.ascontiguousarray(points.T)))
    return np.array(n), np.array(gradient).T


def columns_of(z: np.ndarray, data: np.ndarray) -> CubicHermiteSpline:
    """SciPy's cubics with the slopes at the nodes that have a test of their own (test_field_splines)."""
    return CubicHermiteSpline(z, data, column_slopes(z, data))


def oracle(z: np.ndarray, data: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """n − 1 and its gradient: SciPy's cubics of every column at the height, then its bilinear look-up."""
    columns = columns_of(z, data)
    value, gradient = np.empty(len(points)), np.empty((len(points), 3))
    for number, (x, y, height) in enumerate(points):
        i = min(int(np.searchsorted(X, x, side="right")) - 1, len(X) - 2)
        j = min(int(np.searchsorted(Y, y, side="right")) - 1, len(Y) - 2)
        dx, dy = X[i + 1] - X[i], Y[j + 1] - Y[j]
        u, v = (x - X[i]) / dx, (y - Y[j]) / dy
        (a, b), (c, d) = columns(height)[j : j + 2, i : i + 2]
        value[number] = RegularGridInterpolator((Y, X), columns(height))((y, x))
        gradient[number, 0] = ((1 - v) * (b - a) + v * (d - c)) / dx
        gradient[number, 1] = ((1 - u) * (c - a) + u * (d - b)) / dy
        gradient[number, 2] = RegularGridInterpolator((Y, X), columns(height, 1))((y, x))
    return value, gradient


@HEIGHTS
@pytest.mark.parametrize(
    ("types", "storage", "value_tolerance", "gradient_tolerance"),
    [(DOUBLE, None, 1e-15, 1e-15), (DOUBLE, "single", 1e-12, 1e-10), (SINGLE, None, 2e-7, 1e-9)],
    ids=["double", "stored-single", "single"],
)
def test_values_and_gradients_are_those_of_scipy_column_by_column(
    types: field.Types, storage: Any, value_tolerance: float, gradient_tolerance: float, z: np.ndarray
) -> None:
    data, points = uneven(z), inside(z)
    volume = field.StratifiedVolume(X, Y, z, data, types, storage=storage)
    n, gradient = look_up(volume, points)
    value, slopes = oracle(z, data, points)
    assert np.max(np.abs(n - 1 - value)) < value_tolerance
    assert np.max(np.abs(gradient - slopes)) < gradient_tolerance
    assert np.min(np.max(np.abs(slopes), axis=0)) > 1e-6  # the tolerance can see the data
    assert volume.shape == data.shape


@HEIGHTS
@pytest.mark.parametrize(("types", "tolerance"), [(DOUBLE, 1e-15), (SINGLE, 2e-7)], ids=["double", "single"])
def test_values_at_the_nodes_come_back(types: field.Types, z: np.ndarray, tolerance: float) -> None:
    data = uneven(z)
    volume = field.StratifiedVolume(X, Y, z, data, types)
    heights, y, x = np.meshgrid(z, Y, X, indexing="ij")
    n, _ = look_up(volume, np.stack([x.ravel(), y.ravel(), heights.ravel()], axis=1))
    assert np.max(np.abs(n - 1 - data.ravel())) < tolerance


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_few_nodes_get_the_order_that_they_permit(count: int) -> None:
    z = STRETCHED[-count:]
    data, points = uneven(STRETCHED)[-count:], inside(z, 200)
    n, gradient = look_up(field.StratifiedVolume(X, Y, z, data, DOUBLE), points)
    value, slopes = oracle(z, data, points)
    assert np.max(np.abs(n - 1 - value)) < 1e-15
    assert np.max(np.abs(gradient - slopes)) < 1e-15


@HEIGHTS
def test_two_derivatives_are_continuous_in_height(z: np.ndarray) -> None:
    """Across a face the gradient and the second difference do not jump; trilinear ones do."""
    strength = 1e-5 * np.random.default_rng(6).uniform(1, 2, (1, len(Y), len(X)))
    data, points = 2.7e-4 - strength * np.exp(-z / 0.6)[:, None, None], inside(z, 60)
    thinnest = np.diff(z).min()
    points[:, 2] = z[1:-1][np.arange(60) % (len(z) - 2)]
    h = np.array([0, 0, 1e-5 * thinnest])
    jumps = []
    for volume in (
        field.StratifiedVolume(X, Y, z, data, DOUBLE),
        field.TrilinearVolume(X, Y, z, data, DOUBLE, background="profile"),
    ):
        slopes = [look_up(volume, points + offset * h)[1] for offset in (-2, -1, 0, 1, 2)]
        bends = [np.max(np.abs(b - a)) for a, b in ((slopes[0], slopes[1]), (slopes[3], slopes[4]))]
        second = (slopes[4] - slopes[3]) - (slopes[1] - slopes[0])
        jumps.append((np.max(np.abs(slopes[3] - slopes[1])), np.max(np.abs(second)) / max(bends)))
    # What is left is that the third derivative is not 0.
    assert jumps[0][0] < 1e-2 * jumps[1][0]
    assert jumps[0][1] < 0.02


@HEIGHTS
def test_it_is_bilinear_between_columns(z: np.ndarray) -> None:
    """Along x, and along y, second differences within a cell vanish; the gradient jumps at its faces."""
    volume = field.StratifiedVolume(X, Y, z, uneven(z), DOUBLE)
    points = inside(z, 60)
    for axis, nodes in enumerate((X, Y)):
        lower = nodes[np.arange(60) % (len(nodes) - 1)]
        width = nodes[np.arange(60) % (len(nodes) - 1) + 1] - lower
        line = np.repeat(points[None], 3, axis=0)
        line[:, :, axis] = lower + width * np.array([0.2, 0.5, 0.8])[:, None]
        n = np.array([look_up(volume, part)[0] for part in line])
        assert np.max(np.abs(n[0] - 2 * n[1] + n[2])) < 1e-15
        assert np.max(np.abs(n[0] - n[2])) > 1e-7
        face = points.copy()
        face[:, axis] = nodes[1]
        step = 1e-9 * np.eye(3)[axis]
        before, behind = (look_up(volume, face + way * step)[1] for way in (-1, 1))
        assert np.max(np.abs(before - behind)[:, axis]) > 1e-7
        assert np.max(np.abs(before - behind)[:, 1 - axis]) < 1e-13


@BOTH
@HEIGHTS
def test_extended_columns_go_on_without_horizontal_gradient(types: field.Types, z: np.ndarray) -> None:
    data = uneven(z)
    volume = field.StratifiedVolume(X, Y, z, data, types, "extend")
    beyond = np.array([[500.0, 0.2, 0.4], [-9.0, 0.2, 0.4], [0.3, -70.0, 0.3], [50.0, 70.0, z[-1]]])
    value, expected = oracle(z, data, np.clip(beyond, [X[0], Y[0], z[0]], [X[-1], Y[-1], z[-1]]))
    expected[[0, 1, 3], 0] = 0
    expected[[2, 3], 1] = 0
    points = types.Array3f(np.ascontiguousarray(beyond.T))
    cell = volume.cell(points, types.Array3f(1, -1, -1))
    value_tolerance, tolerance = (1e-15, 1e-15) if types is DOUBLE else (2e-7, 1e-9)
    for n, gradient in (volume.value_and_gradient(points), cell.value_and_gradient(points)):
        assert np.max(np.abs(np.array(n) - 1 - value)) < value_tolerance
        assert np.max(np.abs(np.array(gradient).T - expected)) < tolerance
        assert np.all(np.array(gradient).T[:, :2][expected[:, :2] == 0] == 0)
    assert not field.StratifiedVolume(X, Y, z, data, types).contains(points)[0]


@BOTH
@HEIGHTS
@pytest.mark.parametrize("beyond", ["straight", "extend"])
def test_quiet_blocks_keep_their_promise(types: field.Types, z: np.ndarray, beyond: Any) -> None:
    """Whole blocks are given, and within all of each the gradient is right to `flatness`."""
    x, y, z = (np.interp(np.linspace(0, len(a) - 1, 4 * len(a)), np.arange(len(a)), a) for a in (X, Y, z))
    bump = np.exp(-((x / 0.4) ** 2) - ((y[:, None] / 0.4) ** 2)) * np.exp(-z / 0.3)[:, None, None]
    data = profile(z)[:, None, None] + 1e-6 * bump
    flatness = 5e-7
    quiet = field.StratifiedVolume(x, y, z, data, types, beyond, flatness=flatness)
    plain = field.StratifiedVolume(x, y, z, data, types, beyond)
    random = np.random.default_rng(8)
    points = types.Array3f(np.ascontiguousarray(inside(z, 3000).T))
    cell, small = (air.cell(points, types.Array3f(1, 0.3, 0.1)) for air in (quiet, plain))
    size, cell_size = (np.array(c.upper) - np.array(c.lower) for c in (cell, small))
    times = size / cell_size
    assert np.min(times) > 0.999
    assert np.mean(times[0] > 3) > 0.4
    assert np.any(np.max(times, axis=0) < 1.001)  # where the air is not quiet
    worst = 0.0
    for _ in range(5):
        within = np.array(cell.lower) + size * random.uniform(0.001, 0.999, size.shape)
        position = types.Array3f(within.astype(np.float32 if types is SINGLE else np.float64))
        n, gradient = cell.value_and_gradient(position)
        exact_n, exact = plain.value_and_gradient(position)
        worst = max(worst, float(np.max(np.abs(np.array(gradient) - np.array(exact)))))
        far = flatness * float(np.max(size)) + (3e-7 if types is SINGLE else 0)
        assert np.max(np.abs(np.array(n) - np.array(exact_n))) < far
    assert 0.1 * flatness < worst <= flatness


def test_beside_a_tooth_the_air_is_quiet() -> None:
    """There the chords of a column are level, and so are its cubics; a spline would still swing."""
    x, y, z = np.linspace(0, 8, 9), np.linspace(0, 8, 9), np.linspace(0, 16, 17)
    data = np.full((17, 9, 9), 2.7e-4)
    data[6, 4, 4] += 1e-8
    points = DOUBLE.Array3f([4.5] * 3, [4.5] * 3, [2.5, 6.5, 9.5])
    volume = field.StratifiedVolume(x, y, z, data, DOUBLE, flatness=1.5e-9)
    cell = volume.cell(points, DOUBLE.Array3f(1, 1, 1))
    assert np.array_equal(np.array(cell.upper.x - cell.lower.x), [4, 1, 4])


@HEIGHTS
@pytest.mark.parametrize("beyond", ["straight", "extend"])
def test_stratified_air_needs_no_voxels(z: np.ndarray, beyond: Any) -> None:
    data = np.broadcast_to(profile(z)[:, None, None], (len(z), len(Y), len(X)))
    volume = field.StratifiedVolume(X, Y, z, data, DOUBLE, beyond)
    assert volume._deviation is None
    assert volume.stratified == (beyond == "extend")
    assert not field.StratifiedVolume(X, Y, z, uneven(z), DOUBLE, beyond).stratified
    points = inside(z)
    n, gradient = look_up(volume, points)
    spline = columns_of(z, profile(z))
    assert np.max(np.abs(n - 1 - spline(points[:, 2]))) < 1e-15
    assert np.max(np.abs(gradient[:, 2] - spline(points[:, 2], 1))) < 1e-15
    cell = volume.cell(DOUBLE.Array3f(np.ascontiguousarray(points.T)), DOUBLE.Array3f(1, 1, 1))
    assert np.all(np.array(cell.upper)[0] == (np.inf if beyond == "extend" else X[-1]))


def test_small_ramps_survive_single_precision() -> None:
    """1e-9 across, on top of an exponential profile at 2.7e-4."""
    across = 1e-9 * np.linspace(0, 1, 17)
    data = profile(EVEN)[:, None, None] + np.broadcast_to(across, (len(EVEN), 3, 17))
    volume = field.StratifiedVolume(np.linspace(0, 16, 17), [0, 1, 2], EVEN, data, SINGLE)
    points = np.stack([np.linspace(0.5, 15.5, 16), np.full(16, 0.7), np.full(16, 1.3)], axis=1)
    position = SINGLE.Array3f(np.ascontiguousarray(points.T))
    cell = volume.cell(position, SINGLE.Array3f(1, 0, 0))
    for gradient in (look_up(volume, points)[1].T, np.array(cell.value_and_gradient(position)[1])):
        assert np.max(np.abs(gradient[0] / (1e-9 / 16) - 1)) < 1e-3
    stored_as_n = np.diff((1 + data[0, 0]).astype(np.float32))
    assert np.max(np.abs(stored_as_n / (1e-9 / 16) - 1)) > 0.5


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
def test_one_kernel_serves_every_instant(types: field.Types) -> None:
    """Neither the background nor the voxels are compiled into it, nor where in memory they lie."""
    hashes = []
    for scale in (1.0, 2.0, 3.0, 4.0):
        volume = field.StratifiedVolume(X, Y, EVEN, scale * uneven(EVEN), types, storage="single")
        position = types.Array3f(np.ascontiguousarray(inside(EVEN).T))
        dr.eval(position)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            dr.eval(volume.cell(position, types.Array3f(1, 0, 0)).value_and_gradient(position))
            hashes.append([kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])])
    assert hashes[0]
    assert hashes == hashes[:1] * 4


def test_bad_input_is_refused() -> None:
    axis, data = [0.0, 1.0], np.zeros((2, 2, 2))
    with pytest.raises(InputError, match="does not fit the axes"):
        field.StratifiedVolume([0, 1, 2], axis, axis, data, DOUBLE)
    with pytest.raises(InputError, match="at least two nodes"):
        field.StratifiedVolume(axis, [0.0], axis, np.arange(4.0).reshape(2, 1, 2), DOUBLE)
    with pytest.raises(InputError, match="expected straight, extend or mean"):
        field.StratifiedVolume(axis, axis, axis, data, DOUBLE, beyond="wrap")  # type: ignore[arg-type]
    for flatness in (-1.0, np.inf, np.nan):
        with pytest.raises(InputError, match=r"^flatness: "):
            field.StratifiedVolume(axis, axis, axis, data, DOUBLE, flatness=flatness)
