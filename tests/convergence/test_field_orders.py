"""Order in the cell size of the index and of its gradient, for every interpolation that is offered.

The air is n − 1 = 2.7e-4 − 1e-5 exp(−z) cos x/2 cos y/2 (or without the cosines, where it must be
stratified), whose gradient is known and none of whose derivatives vanishes near the ends of the mesh, where
the error is greatest; errors are the greatest over 27 points of every cell. Meshes are refined by halving
their cells; stretched ones are images of even ones, with cells that grow to e times the first.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from nigemizu import field

TYPES = field.types("llvm", "double")
SIZE = 2.0


def slope(cells: list[int], errors: list[float]) -> float:
    return float(-np.polyfit(np.log(cells), np.log(errors), 1)[0])


def nodes(cells: int, stretched: bool) -> np.ndarray:
    even = np.linspace(0, SIZE, cells + 1)
    return SIZE * np.expm1(even / SIZE) / np.expm1(1) if stretched else even


def errors(kind: Any, axis: np.ndarray, layered: bool, **keywords: Any) -> tuple[float, float]:
    """Greatest error of the value and of the gradient in a volume with these nodes on all axes."""

    def across(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The factor in x or y, and its derivative."""
        return (np.ones_like(s), 0 * s) if layered else (np.cos(s / 2), -np.sin(s / 2) / 2)

    along = across(axis)[0]
    data = 2.7e-4 - 1e-5 * np.exp(-axis)[:, None, None] * along[:, None] * along
    volume = kind(axis, axis, axis, data, TYPES, **keywords)
    probes = (axis[:-1, None] + np.diff(axis)[:, None] * [0.1, 0.5, 0.8]).ravel()
    x, y, z = np.stack(np.meshgrid(probes, probes, probes)).reshape(3, -1)
    n, gradient = volume.value_and_gradient(TYPES.Array3f(x, y, z))
    less, (along_x, slope_x), (along_y, slope_y) = 1e-5 * np.exp(-z), across(x), across(y)
    exact = less * np.array([-slope_x * along_y, -along_x * slope_y, along_x * along_y])
    value_error = np.max(np.abs(np.array(n) - (1 + 2.7e-4 - less * along_x * along_y)))
    return float(value_error), float(np.max(np.abs(np.array(gradient) - exact)))


@pytest.mark.parametrize("stretched", [False, True], ids=["even", "stretched"])
@pytest.mark.parametrize(
    ("kind", "keywords", "layered", "order"),
    [
        (field.TrilinearVolume, {}, False, 2),
        (field.TrilinearVolume, {"background": "profile"}, False, 2),
        (field.TrilinearVolume, {}, True, 2),
        (field.TrilinearVolume, {"background": "profile"}, True, 4),
        (field.TricubicVolume, {}, False, 4),
        (field.TricubicVolume, {}, True, 4),
        (field.StratifiedVolume, {}, False, 2),
        (field.StratifiedVolume, {}, True, 4),
    ],
    ids=[
        "trilinear",
        "profile",
        "layered",
        "layered-profile",
        "tricubic",
        "layered-tricubic",
        "stratified",
        "layered-stratified",
    ],
)
def test_values_are_of_the_order_promised_and_gradients_of_one_less(
    kind: Any, keywords: dict[str, Any], layered: bool, order: int, stretched: bool
) -> None:
    cells = [8, 16, 32]
    found = [errors(kind, nodes(count, stretched), layered, **keywords) for count in cells]
    values, gradients = zip(*found, strict=True)
    assert abs(slope(cells, list(values)) - order) < 0.2
    assert abs(slope(cells, list(gradients)) - (order - 1)) < 0.2


@pytest.mark.parametrize("stretched", [False, True], ids=["even", "stretched"])
def test_splines_of_columns_are_of_fourth_order_in_height_where_the_air_is_uneven(stretched: bool) -> None:
    """Air that is bilinear across, so that only the height of the cells matters; trilinear: second order."""
    cells, across = [8, 16, 32], np.array([0.0, 1.0, 2.0])
    x, y = np.array([0.3, 0.9, 1.7])[:, None], np.array([1.2, 0.4, 1.9])[:, None]
    found: dict[str, list[tuple[float, float]]] = {"StratifiedVolume": [], "TrilinearVolume": []}
    for kind, count in itertools.product((field.StratifiedVolume, field.TrilinearVolume), cells):
        axis = nodes(count, stretched)
        uneven = 1 + 0.3 * across * across[:, None]
        data = 2.7e-4 - 1e-5 * np.exp(-axis)[:, None, None] * uneven
        volume = kind(across, across, axis, data, TYPES)
        z = (axis[:-1, None] + np.diff(axis)[:, None] * [0.1, 0.5, 0.8]).ravel()
        points = [part.ravel() for part in np.broadcast_arrays(x, y, z)]
        n, gradient = volume.value_and_gradient(TYPES.Array3f(*points))
        less = 1e-5 * np.exp(-z)
        exact = np.array(np.broadcast_arrays(-0.3 * less * y, -0.3 * less * x, less * (1 + 0.3 * x * y)))
        value = 1 + 2.7e-4 - less * (1 + 0.3 * x * y)
        wrong = np.array(gradient).reshape(exact.shape) - exact
        errors = np.max(np.abs(np.array(n) - value.ravel())), np.max(np.abs(wrong))
        found[kind.__name__].append((float(errors[0]), float(errors[1])))
    for name, orders in (("StratifiedVolume", (4, 3)), ("TrilinearVolume", (2, 1))):
        for of_kind, order in zip(zip(*found[name], strict=True), orders, strict=True):
            assert abs(slope(cells, list(of_kind)) - order) < 0.2


def test_the_profile_takes_the_error_of_the_layers_out_of_a_volume() -> None:
    """With a small horizontal variation the profile is far better long before it changes the order."""
    axis = np.linspace(0, SIZE, 17)
    uneven = 1e-8 * np.cos(axis)[None, None, :] * np.cos(axis)[None, :, None]
    data = 2.7e-4 - 1e-5 * np.exp(-axis)[:, None, None] + uneven
    points = np.random.default_rng(3).uniform(0, SIZE, (3, 2000))
    worst = []
    for background in ("linear", "profile"):
        volume = field.TrilinearVolume(axis, axis, axis, data, TYPES, background=background)  # type: ignore[arg-type]
        gradient = volume.value_and_gradient(TYPES.Array3f(points))[1]
        worst.append(np.max(np.abs(np.array(gradient.z) - 1e-5 * np.exp(-points[2]))))
    assert worst[1] < worst[0] / 50
