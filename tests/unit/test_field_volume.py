"""The trilinear volume, against SciPy's interpolator and by differences."""

from __future__ import annotations

from typing import Any

import drjit as dr
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from nigemizu import field
from nigemizu.errors import InputError

SINGLE, DOUBLE = field.types("llvm", "single"), field.types("llvm", "double")

X = np.linspace(-2, 3, 7)
Y = np.array([-1.0, -0.5, 0.5, 2.0])
Z = np.concatenate([[0.0], np.cumsum(0.05 * 1.4 ** np.arange(9))])


def uneven(seed: int = 3) -> np.ndarray:
    random = np.random.default_rng(seed)
    return 2.7e-4 + 1e-5 * random.standard_normal((len(Z), len(Y), len(X)))


def inside(count: int, seed: int = 5) -> np.ndarray:
    random = np.random.default_rng(seed)
    return random.uniform([X[0], Y[0], Z[0]], [X[-1], Y[-1], Z[-1]], (count, 3))


def look_up(volume: field.Field, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    n, gradient = volume.value_and_gradient(volume.types.Array3f(np.ascontiguousarray(points.T)))
    return np.array(n), np.array(gradient).T


@pytest.mark.parametrize(
    ("types", "storage", "tolerance"),
    [(DOUBLE, None, 1e-15), (DOUBLE, "single", 5e-12), (SINGLE, None, 2e-7)],
)
def test_values_are_those_of_scipy(types: field.Types, storage: Any, tolerance: float) -> None:
    data = uneven()
    volume = field.TrilinearVolume(X, Y, Z, data, types, storage=storage)
    points = inside(2000)
    expected = 1 + RegularGridInterpolator((Z, Y, X), data)(points[:, ::-1])
    n, _ = look_up(volume, points)
    assert np.max(np.abs(n - expected)) < tolerance
    assert np.ptp(expected) > 2e-5  # the tolerance can see the data


def test_order_of_the_data_is_z_y_x() -> None:
    data = np.zeros((len(Z), len(Y), len(X)))
    data[2, 1, 4] = 1e-4
    volume = field.TrilinearVolume(X, Y, Z, data, DOUBLE)
    n, _ = look_up(volume, np.array([[X[4], Y[1], Z[2]], [X[2], Y[1], Z[4]]]))
    assert np.allclose(n - 1, [1e-4, 0], rtol=0, atol=1e-15)


def test_gradient_is_that_of_the_interpolant() -> None:
    data = uneven()
    volume = field.TrilinearVolume(X, Y, Z, data, DOUBLE)
    exact = RegularGridInterpolator((Z, Y, X), data)
    nodes = (X, Y, Z)
    points = inside(1500)
    # Only points whose difference stencils stay in one cell: the interpolant has kinks on the faces.
    h = 1e-4
    clear = np.all([np.min(np.abs(points[:, [a]] - nodes[a]), axis=1) > 2 * h for a in range(3)], axis=0)
    points = points[clear]
    assert len(points) > 1000
    _, gradient = look_up(volume, points)
    for axis in range(3):
        shift = np.zeros(3)
        shift[axis] = h
        slope = (exact((points + shift)[:, ::-1]) - exact((points - shift)[:, ::-1])) / (2 * h)
        assert np.max(np.abs(gradient[:, axis] - slope)) < 1e-12
    assert np.max(np.abs(gradient)) > 1e-6


def test_gradient_on_a_face_is_that_of_the_cell_above() -> None:
    profile = np.array([0.0, 1.0, 4.0, 9.0]) * 1e-6
    z = np.array([0.0, 1.0, 2.0, 3.0])
    data = np.broadcast_to(profile[:, None, None], (4, 2, 2))
    volume = field.TrilinearVolume([0, 1], [0, 1], z, data, DOUBLE)
    points = np.array([[0.5, 0.5, h] for h in (0.0, 1.0, np.nextafter(1.0, 0), 2.0, 3.0)])
    _, gradient = look_up(volume, points)
    assert np.allclose(gradient[:, 2], [1e-6, 3e-6, 1e-6, 5e-6, 5e-6], rtol=1e-9)
    assert np.max(np.abs(gradient[:, :2])) < 1e-20


def test_straight_ends_at_the_box() -> None:
    volume = field.TrilinearVolume(X, Y, Z, uneven(), DOUBLE)
    points = DOUBLE.Array3f([0.0, 3.1, 0.0, 0.0], [0.0, 0.0, -1.1, 0.0], [0.1, 0.1, 0.1, -0.01])
    assert list(volume.contains(points)) == [True, False, False, False]
    assert volume.shape == (len(Z), len(Y), len(X))


def test_extended_columns_go_on_without_horizontal_gradient() -> None:
    data = uneven()
    volume = field.TrilinearVolume(X, Y, Z, data, DOUBLE, beyond="extend")
    points = DOUBLE.Array3f([500.0, 0.3, 0.3], [0.2, -70.0, 0.2], [0.4, 0.4, Z[-1] + 1])
    assert list(volume.contains(points)) == [True, True, False]
    n, gradient = volume.value_and_gradient(points)
    edge = RegularGridInterpolator((Z, Y, X), data)([[0.4, 0.2, X[-1]], [0.4, Y[0], 0.3]])
    assert np.allclose(np.array(n)[:2], 1 + edge, rtol=0, atol=1e-15)
    gradient = np.array(gradient)
    assert gradient[0, 0] == 0
    assert gradient[1, 1] == 0
    assert abs(gradient[1, 0]) > 1e-8  # along the edge the air does vary
    assert abs(gradient[0, 1]) > 1e-8


def test_air_without_breadth_is_extended() -> None:
    data = np.broadcast_to(np.linspace(1e-4, 2e-4, 3)[:, None, None], (3, 1, 2))
    volume = field.TrilinearVolume([0, 10], [0], [0, 1, 2], data, DOUBLE, beyond="extend")
    n, gradient = look_up(volume, np.array([[5.0, 33.0, 0.5]]))
    assert np.allclose(n, 1.000125, rtol=0, atol=1e-15)
    assert np.allclose(gradient, [[0, 0, 5e-5]], rtol=1e-12)
    with pytest.raises(InputError, match="at least two nodes"):
        field.TrilinearVolume([0, 10], [0], [0, 1, 2], data, DOUBLE)


def test_small_ramp_survives_single_precision() -> None:
    """1e-9 over 16 cells on top of n − 1 = 2.7e-4 comes out to 1 %; stored as n it would not."""
    ramp = 1e-9 * np.linspace(0, 1, 17)
    data = 2.7e-4 + np.broadcast_to(ramp, (3, 3, 17))
    x = np.linspace(0, 16, 17)
    volume = field.TrilinearVolume(x, [0, 1, 2], [0, 1, 2], data, SINGLE)
    points = np.stack([np.linspace(0.5, 15.5, 16), np.full(16, 0.7), np.full(16, 1.3)], axis=1)
    _, gradient = look_up(volume, points)
    true = 1e-9 / 16
    assert np.max(np.abs(gradient[:, 0] / true - 1)) < 0.01
    stored_as_n = np.diff((1 + data[0, 0]).astype(np.float32))
    assert np.max(np.abs(stored_as_n / true - 1)) > 0.5


def test_strong_linear_background_leaves_the_digits_to_the_rest() -> None:
    """A steep linear profile is carried in closed form: a 1e-10 ramp across it is still there to 1 %."""
    z = np.linspace(0, 10, 11)
    data = 3e-4 - 1e-5 * z[:, None, None] + 1e-10 * np.linspace(0, 1, 9)[None, None, :] * np.ones((11, 2, 1))
    volume = field.TrilinearVolume(np.linspace(0, 8, 9), [0, 1], z, data, SINGLE)
    _, gradient = look_up(volume, np.array([[2.5, 0.5, 3.3], [6.5, 0.2, 8.8]]))
    assert np.allclose(gradient[:, 0], 1e-10 / 8, rtol=0.01)
    assert np.allclose(gradient[:, 2], -1e-5, rtol=1e-6)


def test_bad_data_is_refused() -> None:
    good = np.zeros((2, 2, 2))
    axis = [0.0, 1.0]
    with pytest.raises(InputError, match=r"does not fit the axes.*\(2, 2, 3\)"):
        field.TrilinearVolume([0, 1, 2], axis, axis, good, DOUBLE)
    with pytest.raises(InputError, match="not finite"):
        field.TrilinearVolume(axis, axis, axis, np.full((2, 2, 2), np.nan), DOUBLE)
    with pytest.raises(InputError, match="expected straight, extend or mean"):
        field.TrilinearVolume(axis, axis, axis, good, DOUBLE, beyond="wrap")  # type: ignore[arg-type]


def test_entry_into_the_box() -> None:
    volume = field.TrilinearVolume([0, 1], [0, 1], [0, 1], np.zeros((2, 2, 2)), DOUBLE)
    origin = DOUBLE.Array3f(
        [-2.0, 0.5, -2.0, 0.5, -1.0], [0.5, 0.5, 2.0, 0.5, 0.0], [0.5, 0.5, 0.5, 3.0, 0.5]
    )
    ahead = DOUBLE.Array3f([1.0, 0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 1.0, 0.0])
    assert list(volume.entry(origin, ahead)) == [2.0, 0.0, dr.inf, dr.inf, 1.0]


def test_placed_volume_turns_scales_and_moves() -> None:
    """A volume whose z is the scene's y, in centimetres, moved: n is the same, the gradient turned."""
    inner = field.TrilinearVolume(X, Y, Z, uneven(), DOUBLE)
    rotation = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = 100 * rotation, [5, -7, 11]
    placed = field.Placed(inner, to_world)
    points = inside(50)
    world = points @ to_world[:3, :3].T + to_world[:3, 3]
    n, gradient = look_up(inner, points)
    n_world, gradient_world = look_up(placed, world)
    assert np.allclose(n, n_world, rtol=0, atol=1e-13)
    assert np.allclose(gradient @ rotation.T / 100, gradient_world, rtol=1e-6, atol=1e-16)
    assert np.all(np.array(placed.contains(DOUBLE.Array3f(np.ascontiguousarray(world.T)))))
    start = DOUBLE.Array3f(*(to_world @ [-4.0, 0.0, 0.2, 1])[:3].tolist())
    assert abs(placed.entry(start, DOUBLE.Array3f(1, 0, 0))[0] - 200) < 1e-10


@pytest.mark.parametrize(
    "linear",
    [np.diag([1.0, 1.0, 2.0]), np.diag([1.0, 1.0, -1.0]), np.array([[1.0, 0.1, 0], [0, 1, 0], [0, 0, 1]])],
)
def test_placing_that_bends_space_is_refused(linear: np.ndarray) -> None:
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    with pytest.raises(InputError, match=r"^to_world: the transform bends space"):
        field.Placed(field.Uniform(DOUBLE), matrix)


@pytest.mark.parametrize("types", [SINGLE, DOUBLE], ids=["single", "double"])
def test_analytic_gradients_are_those_of_the_values(types: field.Types) -> None:
    fields = [
        field.Uniform(types, 1.3),
        field.LinearSquare(types, 2.25, -0.5),
        field.ExponentialSquare(types, 2.0, 0.4, 0.5),
        field.ParabolicGrin(types, 1.5, 0.3),
        field.Fisheye(types),
        field.Luneburg(types),
        field.ExponentialTemperature(types, 300.0, 100.0, 2.0, 90.0),
        field.GaussianBlob(types, 0.3, 0.5),
    ]
    points = np.array([[0.1, 0.3, 0.2], [-0.4, 0.2, 0.5], [0.5, -0.5, 0.1]])
    h = 1e-2 if types is SINGLE else 1e-4
    for air in fields:
        _, gradient = look_up(air, points)
        for axis in range(3):
            shift = np.zeros(3)
            shift[axis] = h
            slope = (look_up(air, points + shift)[0] - look_up(air, points - shift)[0]) / (2 * h)
            tolerance = 2e-3 if types is SINGLE else 1e-6
            assert np.all(np.abs(gradient[:, axis] - slope) < tolerance), air
