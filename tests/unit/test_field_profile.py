"""The spline background of the trilinear volume, against SciPy, and what it keeps of small differences."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, RegularGridInterpolator

from nigemizu import field
from nigemizu.errors import InputError
from nigemizu.field.background import chord_pieces, merged_pieces, spline_pieces
from nigemizu.field.splines import column_slopes

SINGLE, DOUBLE = field.types("llvm", "single"), field.types("llvm", "double")

X = np.linspace(-2, 3, 7)
Y = np.array([-1.0, -0.5, 0.5, 2.0])
EVEN = np.linspace(0, 2, 21)
STRETCHED = np.concatenate([[0.0], np.cumsum(0.02 * 1.25 ** np.arange(14))])
HEIGHTS = pytest.mark.parametrize("z", [EVEN, STRETCHED], ids=["even", "stretched"])


def profile(z: np.ndarray) -> np.ndarray:
    return 2.7e-4 - 2e-5 * np.exp(-z / 0.3)


def spline_of(z: np.ndarray, values: np.ndarray) -> CubicHermiteSpline:
    """SciPy's cubics with the slopes at the nodes that have a test of their own (test_field_splines)."""
    return CubicHermiteSpline(z, values, column_slopes(z, values))


def uneven(z: np.ndarray) -> np.ndarray:
    random = np.random.default_rng(4)
    return profile(z)[:, None, None] + 1e-7 * random.standard_normal((len(z), len(Y), len(X)))


def look_up(volume: field.Field, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    n, gradient = volume.value_and_gradient(volume.types.Array3f(np.ascontiguousarray(points.T)))
    return np.array(n), np.array(gradient).T


def inside(z: np.ndarray, count: int = 500) -> np.ndarray:
    random = np.random.default_rng(5)
    return random.uniform([X[0], Y[0], z[0]], [X[-1], Y[-1], z[-1]], (count, 3))


@HEIGHTS
@pytest.mark.parametrize(("types", "tolerance"), [(DOUBLE, 1e-15), (SINGLE, 2e-7)], ids=["double", "single"])
def test_values_at_the_nodes_come_back(types: field.Types, z: np.ndarray, tolerance: float) -> None:
    data = uneven(z)
    volume = field.TrilinearVolume(X, Y, z, data, types, background="profile")
    heights, y, x = np.meshgrid(z, Y, X, indexing="ij")
    n, _ = look_up(volume, np.stack([x.ravel(), y.ravel(), heights.ravel()], axis=1))
    assert np.max(np.abs(n - 1 - data.ravel())) < tolerance


@HEIGHTS
def test_it_is_a_spline_through_the_means_and_a_trilinear_rest(z: np.ndarray) -> None:
    data, points = uneven(z), inside(z)
    n, gradient = look_up(field.TrilinearVolume(X, Y, z, data, DOUBLE, background="profile"), points)
    means = data.mean(axis=(1, 2))
    spline = spline_of(z, means)
    rest = RegularGridInterpolator((z, Y, X), data - means[:, None, None])
    assert np.max(np.abs(n - 1 - spline(points[:, 2]) - rest(points[:, ::-1]))) < 1e-15
    plain = look_up(field.TrilinearVolume(X, Y, z, data, DOUBLE), points)
    assert np.max(np.abs(gradient[:, :2] - plain[1][:, :2])) < 1e-16
    # In z the spline's slope takes the place of the chords'.
    cell = np.clip(np.searchsorted(z, points[:, 2], side="right") - 1, 0, len(z) - 2)
    chords = (np.diff(means) / np.diff(z))[cell]
    assert np.max(np.abs(gradient[:, 2] - plain[1][:, 2] - (spline(points[:, 2], 1) - chords))) < 1e-15
    assert np.max(np.abs(gradient[:, 2] - plain[1][:, 2])) > 1e-6


@pytest.mark.parametrize("count", [2, 3, 4])
def test_few_nodes_get_the_order_that_they_permit(count: int) -> None:
    z = STRETCHED[-count:]
    coefficients = np.array([2.7e-4, 1e-5, -3e-6, 2e-6])[:count]
    data = np.broadcast_to(np.polynomial.Polynomial(coefficients)(z)[:, None, None], (count, 2, 2))
    volume = field.TrilinearVolume([0, 1], [0, 1], z, data, DOUBLE, background="profile")
    points = np.stack([np.full(9, 0.3), np.full(9, 0.3), np.linspace(z[0], z[-1], 9)], axis=1)
    n, gradient = look_up(volume, points)
    exact = np.polynomial.Polynomial(coefficients)
    assert np.max(np.abs(n - 1 - exact(points[:, 2]))) < 1e-15
    assert np.max(np.abs(gradient[:, 2] - exact.deriv()(points[:, 2]))) < 1e-17


def test_small_ramps_survive_single_precision() -> None:
    """1e-9 across, and up, on top of an exponential profile at 2.7e-4."""
    z = EVEN
    across = 1e-9 * np.linspace(0, 1, 17)
    data = profile(z)[:, None, None] + np.broadcast_to(across, (len(z), 3, 17))
    volume = field.TrilinearVolume(np.linspace(0, 16, 17), [0, 1, 2], z, data, SINGLE, background="profile")
    points = np.stack([np.linspace(0.5, 15.5, 16), np.full(16, 0.7), np.full(16, 1.3)], axis=1)
    _, gradient = look_up(volume, points)
    assert np.max(np.abs(gradient[:, 0] / (1e-9 / 16) - 1)) < 1e-3
    up = 2.7e-4 + 1e-9 * z / 2
    layered = np.broadcast_to(up[:, None, None], (len(z), 2, 2))
    volume = field.TrilinearVolume([0, 1], [0, 1], z, layered, SINGLE, background="profile")
    _, gradient = look_up(volume, inside(z) * [0.1, 0.1, 1] + [0.3, 0.3, 0])
    assert np.max(np.abs(gradient[:, 2] / 0.5e-9 - 1)) < 1e-3
    stored_as_n = np.diff((1 + up).astype(np.float32)) / np.diff(z)
    assert np.max(np.abs(stored_as_n / 0.5e-9 - 1)) > 0.5


@pytest.mark.parametrize("background", ["linear", "profile"])
@pytest.mark.parametrize("beyond", ["straight", "extend"])
@HEIGHTS
def test_stratified_air_needs_no_voxels(z: np.ndarray, beyond: Any, background: Any) -> None:
    data = np.broadcast_to(profile(z)[:, None, None], (len(z), len(Y), len(X)))
    volume = field.TrilinearVolume(X, Y, z, data, DOUBLE, beyond, background=background)
    assert volume._deviation is None
    assert volume.stratified == (beyond == "extend")
    assert not field.TrilinearVolume(X, Y, z, uneven(z), DOUBLE, beyond, background=background).stratified
    points = inside(z)
    n, gradient = look_up(volume, points)
    if background == "profile":
        spline = spline_of(z, profile(z))
        value, slope = spline(points[:, 2]), spline(points[:, 2], 1)
    else:
        cell = np.searchsorted(z, points[:, 2], side="right") - 1
        slope = (np.diff(profile(z)) / np.diff(z))[cell]
        value = np.interp(points[:, 2], z, profile(z))
    assert np.max(np.abs(n - 1 - value)) < 1e-15
    assert np.max(np.abs(gradient[:, 2] - slope)) < 1e-15
    position = DOUBLE.Array3f(np.ascontiguousarray(points.T))
    cell = volume.cell(position, DOUBLE.Array3f(1, 1, 1))
    assert np.max(np.abs(np.array(cell.value_and_gradient(position)[1]).T - gradient)) < 1e-15
    widest = np.inf if beyond == "extend" else X[-1]
    assert np.all(np.array(cell.upper)[0] == widest)
    assert np.all((points[:, 2] >= np.array(cell.lower)[2]) & (points[:, 2] <= np.array(cell.upper)[2]))


@HEIGHTS
@pytest.mark.parametrize("tolerance", [1e-9, 1e-7, 1e-6])
def test_joined_cells_keep_the_slope(z: np.ndarray, tolerance: float) -> None:
    spline = spline_of(z, profile(z))
    joined, edges = merged_pieces(z, spline_pieces(z, profile(z)), tolerance)
    heights = np.linspace(z[0], z[-1], 4001)[:-1]
    piece = np.searchsorted(edges, heights, side="right") - 1
    lengths = np.diff(edges)
    w = (heights - edges[piece]) / lengths[piece]
    c = joined[piece].T
    slope = (c[1] + (2 * c[2] + 3 * c[3] * w) * w) / lengths[piece]
    value = c[0] + (c[1] + (c[2] + c[3] * w) * w) * w
    assert np.max(np.abs(slope - spline(heights, 1))) <= tolerance * 1.001
    assert np.max(np.abs(value - spline(heights))) <= tolerance * lengths.max()
    assert np.max(np.abs(joined[:-1].sum(axis=1) - joined[1:, 0])) < 1e-18
    assert set(edges) <= set(z)
    if tolerance == 1e-6:
        assert len(lengths) < len(z) // 2


@HEIGHTS
def test_flat_profiles_are_crossed_in_few_cells(z: np.ndarray) -> None:
    data = np.broadcast_to(profile(z)[:, None, None], (len(z), 2, 2))
    flat = field.TrilinearVolume(
        [0, 1], [0, 1], z, data, DOUBLE, "extend", background="profile", flatness=4e-6
    )
    points = inside(z)
    position = DOUBLE.Array3f(np.ascontiguousarray(points.T))
    cell = flat.cell(position, DOUBLE.Array3f(1, 0, 0))
    errors = np.abs(np.array(cell.value_and_gradient(position)[1].z) - look_up(flat, points)[1][:, 2])
    assert 1e-8 < np.max(errors) <= 1e-6
    assert len(np.unique(np.array(cell.lower)[2])) < len(z) // 2
    assert np.array_equal(np.unique(np.array(cell.upper)[2])[-1:], z[-1:])


@pytest.mark.parametrize("background", ["linear", "profile"])
def test_one_kernel_serves_every_instant(background: Any) -> None:
    """Neither the background nor the voxels are compiled into it, nor where in memory they lie."""
    hashes = []
    for scale in (1.0, 2.0, 3.0, 4.0):
        data = scale * uneven(EVEN)
        volume = field.TrilinearVolume(X, Y, EVEN, data, SINGLE, background=background)
        position = SINGLE.Array3f(np.ascontiguousarray(inside(EVEN).T))
        dr.eval(position)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            dr.eval(volume.cell(position, SINGLE.Array3f(1, 0, 0)).value_and_gradient(position))
            hashes.append([kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])])
    assert hashes[0]
    assert hashes == hashes[:1] * 4


def test_pieces_without_a_spline_are_chords() -> None:
    pieces = chord_pieces(np.array([1.0, 3.0, 2.0]))
    assert np.array_equal(pieces, [[1, 2, 0, 0], [3, -1, 0, 0]])


def test_bad_names_and_numbers_are_refused() -> None:
    data = np.zeros((2, 2, 2))
    axis = [0.0, 1.0]
    with pytest.raises(InputError, match="expected linear or profile"):
        field.TrilinearVolume(axis, axis, axis, data, DOUBLE, background="spline")  # type: ignore[arg-type]
    for flatness in (-1.0, np.inf, np.nan):
        with pytest.raises(InputError, match=r"^flatness: "):
            field.TrilinearVolume(axis, axis, axis, data, DOUBLE, flatness=flatness)
