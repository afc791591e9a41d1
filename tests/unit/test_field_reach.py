"""Cells of fields in closed form and of placed fields: no step may overlook what lies ahead."""

from __future__ import annotations

import numpy as np
import pytest

from nigemizu import field

SINGLE, DOUBLE = field.types("llvm", "single"), field.types("llvm", "double")

MESH = (np.linspace(-2, 3, 11), np.linspace(-1, 2, 7), np.linspace(0, 4, 17))


def ahead(x: float, y: float, z: float) -> object:
    return DOUBLE.Array3f(float(x), float(y), float(z))


def stratified_volume() -> field.TrilinearVolume:
    data = np.broadcast_to(3e-4 - 1e-5 * np.exp(-MESH[2])[:, None, None], (17, 7, 11))
    return field.TrilinearVolume(*MESH, data, DOUBLE, "extend")


def test_a_field_without_cells_is_one_cell() -> None:
    air = field.Uniform(DOUBLE, 1.3)
    cell = air.cell(ahead(0, 0, 0), ahead(1, 0, 0))
    assert (cell.lower, cell.upper, cell.reach) == (None, None, None)
    assert cell.value_and_gradient(ahead(1, 2, 3))[0][0] == 1.3
    assert cell.exit(ahead(0, 0, 0), ahead(1, 0, 0)) == np.inf


@pytest.mark.parametrize("slope", [-1e-3, -0.1, -3.0])
@pytest.mark.parametrize("exponential", ["square", "temperature"])
def test_a_falling_ray_feels_the_layer_before_it_is_deep_in_it(slope: float, exponential: str) -> None:
    """From 20 m: every step ends where the gradient is at most e² times what it was, or next to nothing."""
    air: field.Field = field.ExponentialSquare(DOUBLE, 1.0005, 5e-5, 0.05)
    if exponential == "temperature":
        air = field.ExponentialTemperature(DOUBLE, decay=20.0)
    top = float(air.value_and_gradient(ahead(0, 0, 0))[1].z[0]) * 1e-6
    z, steps = 20.0, 0
    while z > 0.01:
        reach = float(air.cell(ahead(0, 0, z), ahead(2.0, 0, 2.0 * slope)).reach[0])
        before = float(air.value_and_gradient(ahead(0, 0, z))[1].z[0])
        z += reach * slope / np.hypot(1, slope)
        after = float(air.value_and_gradient(ahead(0, 0, z))[1].z[0])
        assert after <= max(np.exp(2.001) * before, 1.01 * top)
        steps += 1
    assert steps <= 9
    for rising in (0.0, 1e-3):  # feels all there is at once
        assert air.cell(ahead(0, 0, 0.01), ahead(1, 0, rising)).reach[0] == np.inf


def test_stratified_fields_say_so() -> None:
    turned = np.eye(4)
    turned[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    about_z = np.eye(4)
    about_z[:2, :2] = [[0.6, -0.8], [0.8, 0.6]]
    layered = [
        field.Uniform(DOUBLE),
        field.LinearSquare(DOUBLE, 1.0, 1e-5),
        field.ExponentialSquare(DOUBLE, 1.0005, 5e-5, 0.05),
        field.ExponentialTemperature(DOUBLE),
        stratified_volume(),
        field.Placed(stratified_volume(), about_z),
    ]
    others = [
        field.Fisheye(DOUBLE),
        field.GaussianBlob(DOUBLE, 1e-5, 0.1),
        field.Placed(stratified_volume(), turned),
        field.TrilinearVolume(*MESH, np.full((17, 7, 11), 3e-4), DOUBLE),
    ]
    assert [air.stratified for air in layered] == [True] * len(layered)
    assert [air.stratified for air in others] == [False] * len(others)


def test_a_blob_is_not_stepped_over() -> None:
    air = field.GaussianBlob(DOUBLE, 1e-5, 0.2)
    towards, past, away = ahead(1, 0.01, 0), ahead(1, 0.1, 0), ahead(-1, 0, 0)
    far = ahead(-100, 0, 3)
    edge = -100 + float(air.cell(far, towards).reach[0]) / np.hypot(1, 0.01)
    assert np.hypot(edge, (edge + 100) * 0.01) == pytest.approx(7 * 0.2, rel=1e-9)
    assert air.cell(far, past).reach[0] == np.inf
    assert air.cell(far, away).reach[0] == np.inf
    assert air.cell(ahead(0.01, 0, 0), towards).reach[0] == pytest.approx(0.2, rel=1e-3)
    # Along its axis the blob does not change.
    assert air.cell(ahead(0.01, 0, 0), ahead(0.1, 0, np.sqrt(0.99))).reach[0] == pytest.approx(2.0, rel=1e-9)
    x, steps = -100.0, 0
    while x < 0:
        reach = float(air.cell(ahead(x, 0, 0), ahead(1, 0, 0)).reach[0])
        assert reach >= 0.2
        x += reach
        steps += 1
    assert steps < 8


def test_the_edge_of_luneburgs_lens_is_met() -> None:
    lens = field.Luneburg(DOUBLE)
    start, direction = ahead(-3, 0.6, 0), ahead(2, 0, 0)
    cell = lens.cell(start, direction)
    assert cell.reach[0] == pytest.approx(3 - 0.8, rel=1e-12)
    assert cell.value_and_gradient(ahead(-0.5, 0, 0))[0][0] == 1  # the formula outside goes on inside
    edge = ahead(-0.8, 0.6, 0)
    inner = lens.cell(edge, direction)
    assert inner.value_and_gradient(ahead(-1.0, 0.6, 0))[0][0] == pytest.approx(np.sqrt(2 - 1.36), rel=1e-12)
    assert inner.reach[0] == 0.5
    outer = lens.cell(ahead(0.8, 0.6, 0), direction)
    assert outer.reach[0] == np.inf
    assert outer.value_and_gradient(ahead(0.7, 0.6, 0))[1].x[0] == 0
    leaving = lens.cell(ahead(0.7, 0.6, 0), direction)
    assert leaving.reach[0] == pytest.approx(0.1, rel=1e-9)
    assert lens.cell(start, ahead(0, 1, 0)).reach[0] == np.inf


def test_reach_follows_the_scale_of_the_field() -> None:
    fibre = field.ParabolicGrin(DOUBLE, 1.5, 0.25)
    assert fibre.cell(ahead(0, 0, 0), ahead(1, 0, 0)).reach[0] == 2.0
    eye = field.Fisheye(DOUBLE)
    assert eye.cell(ahead(0, 0, 0), ahead(1, 0, 0)).reach[0] == 0.5
    ramp = field.LinearSquare(DOUBLE, 1.0, -0.5)
    assert ramp.cell(ahead(0, 0, 1), ahead(1, 0, 0)).reach[0] == 0.5
    assert field.LinearSquare(DOUBLE, 1.0, 0.0).cell(ahead(0, 0, 1), ahead(1, 0, 0)).reach is None
    centimetres = np.diag([100.0, 100.0, 100.0, 1.0])
    placed = field.Placed(fibre, centimetres).cell(ahead(0, 0, 0), ahead(3, 0, 0))
    assert placed.reach[0] == pytest.approx(200, rel=1e-12)


def volume() -> field.TrilinearVolume:
    random = np.random.default_rng(3)
    return field.TrilinearVolume(*MESH, 3e-4 + 1e-5 * random.standard_normal((17, 7, 11)), DOUBLE, "extend")


@pytest.mark.parametrize(
    "rotation",
    [
        np.eye(3),
        np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
        np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    ],
)
def test_bounds_of_a_placed_cell_where_axes_go_to_axes(rotation: np.ndarray) -> None:
    inner = volume()
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = 10 * rotation, [5, -7, 11]
    placed = field.Placed(inner, to_world)
    # inside, and in a column that is extended by 20 km
    points, directions = np.array([[0.3, 0.2, 1.1], [9.0, 0.2, 1.1]]), np.array([[1, 1, 1], [1.0, -1, 1]])
    world = points @ to_world[:3, :3].T + to_world[:3, 3]
    cell = inner.cell(DOUBLE.Array3f(points.T.copy()), DOUBLE.Array3f(directions.T.copy()))
    position = DOUBLE.Array3f(world.T.copy())
    outer = placed.cell(position, DOUBLE.Array3f((directions @ rotation.T).T.copy()))
    corners = np.stack([np.array(cell.lower), np.array(cell.upper)])
    moved = np.einsum("ij,cjr->cir", 10 * rotation, corners) + to_world[:3, 3][None, :, None]
    low, high = moved.min(axis=0), moved.max(axis=0)
    found_low, found_high = np.array(outer.lower), np.array(outer.upper)
    assert np.allclose(found_low, low, rtol=1e-12)
    assert np.allclose(found_high, high, rtol=1e-12)
    assert np.sum(np.abs(found_low) > 1e5) + np.sum(np.abs(found_high) > 1e5) == 1
    n, gradient = outer.value_and_gradient(position)
    expected_n, expected = placed.value_and_gradient(position)
    assert np.allclose(np.array(n), np.array(expected_n), rtol=0, atol=1e-14)
    assert np.allclose(np.array(gradient), np.array(expected), rtol=1e-9, atol=1e-16)


def test_reach_of_a_turned_cell_ends_at_its_faces() -> None:
    inner = volume()
    c, s = np.cos(0.3), np.sin(0.3)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = 10 * rotation, [5, -7, 11]
    placed = field.Placed(inner, to_world)
    random = np.random.default_rng(8)
    points = random.uniform([-1.9, -0.9, 0.1], [2.9, 1.9, 3.9], (300, 3))
    directions = random.standard_normal((300, 3))
    world = points @ to_world[:3, :3].T + to_world[:3, 3]
    position, direction = DOUBLE.Array3f(world.T.copy()), DOUBLE.Array3f((directions @ rotation.T).T.copy())
    cell = placed.cell(position, direction)
    assert cell.lower is None
    unit = directions @ rotation.T / np.linalg.norm(directions, axis=1)[:, None]
    reached = world + np.array(cell.reach)[:, None] * unit
    local = (reached - to_world[:3, 3]) @ rotation / 10
    to_face = np.min([np.min(np.abs(local[:, [a]] - MESH[a]), axis=1) for a in range(3)], axis=0)
    assert np.max(to_face) < 1e-4
    # and not to a face behind the next one
    halfway = points + 0.5 * (local - points)
    for a in range(3):
        assert (
            np.mean(np.searchsorted(MESH[a], halfway[:, a]) == np.searchsorted(MESH[a], points[:, a])) > 0.99
        )
    n, gradient = cell.value_and_gradient(position)
    expected_n, expected = placed.value_and_gradient(position)
    assert np.allclose(np.array(n), np.array(expected_n), rtol=0, atol=1e-9)
    assert np.median(np.abs(np.array(gradient) - np.array(expected))) < 1e-15
