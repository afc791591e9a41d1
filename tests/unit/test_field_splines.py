"""Slopes of columns: those of the spline where the data are smooth, and without extremes on a kink."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from nigemizu.field.splines import column_slopes

STRETCHED = np.concatenate([[0.0], np.cumsum(0.005 * 1.05 ** np.arange(40))])
# Refractivity [1e-6] over asphalt at 62 degC as a computed flow gives it: the skin, then thin cells.
HEIGHTS = np.array([0.0, 0.005, 0.01556, 0.02728, 0.04032, 0.0548, 0.07088, 0.08876])
SKIN = np.array([238.90, 250.87, 252.74, 254.14, 255.25, 256.13, 256.82, 257.37])


@pytest.mark.parametrize(
    "curve",
    [
        lambda z: np.exp(-z / 0.3),
        lambda z: np.sin(7 * z + 0.3),
        lambda z: (z - 0.31) ** 2,
        lambda z: np.tanh((z - 0.3) / 0.2),
    ],
    ids=["layer", "waves", "hill", "step"],
)
def test_smooth_columns_are_those_of_scipy(curve) -> None:
    """Monotone or not: the bounds lie beyond the slopes of the spline."""
    values = curve(STRETCHED)
    slopes, spline = column_slopes(STRETCHED, values), CubicSpline(STRETCHED, values)
    assert np.max(np.abs(slopes - spline(STRETCHED, 1))) < 2e-13 * np.max(np.abs(slopes))


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_polynomials_of_low_degree_come_back(count: int) -> None:
    z = STRETCHED[-count:]
    exact = np.polynomial.Polynomial(np.array([1.0, 0.5, 0.2, 0.1])[:count])
    assert np.max(np.abs(column_slopes(z, exact(z)) - exact.deriv()(z))) < 1e-13


def test_the_skin_of_hot_ground_makes_no_duct() -> None:
    """n rises everywhere. SciPy's spline falls again above the skin, and light would be caught there."""
    z = np.linspace(0, HEIGHTS[-1], 2000)
    ours = CubicHermiteSpline(HEIGHTS, SKIN, column_slopes(HEIGHTS, SKIN))(z, 1)
    assert np.min(ours) > 0.5 * np.min(np.diff(SKIN) / np.diff(HEIGHTS))
    assert np.min(CubicSpline(HEIGHTS, SKIN)(z, 1)) < -200  # 1e-6 per metre


@pytest.mark.parametrize("seed", range(20))
def test_layers_stay_monotone(seed: int) -> None:
    """Rises that slow down, by factors of up to a thousand, as the temperature over a ground does."""
    random = np.random.default_rng(seed)
    z = np.concatenate([[0.0], np.cumsum(0.1 * random.uniform(1, 3, 20))])
    steepness = np.sort(10 ** random.uniform(-3, 0, 20))[::-1]
    values = np.concatenate([[0.0], np.cumsum(steepness * np.diff(z))])
    values = values if seed % 2 else -values
    fine = np.linspace(z[0], z[-1], 5000)
    slope = CubicHermiteSpline(z, values, column_slopes(z, values))(fine, 1) * (1 if seed % 2 else -1)
    assert np.min(slope) >= -1e-12


def test_columns_do_not_know_each_other() -> None:
    random = np.random.default_rng(3)
    values = random.standard_normal((len(STRETCHED), 3, 4))
    together = column_slopes(STRETCHED, values)
    for j, i in np.ndindex(3, 4):
        assert np.array_equal(together[:, j, i], column_slopes(STRETCHED, values[:, j, i]))
