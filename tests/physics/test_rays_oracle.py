"""Controlled steps against brute force: tiny equal steps in double precision, through random voxels.

The oracle's steps of 2 mm know nothing of cells, which are metres long; its own error is what doubling them
changes, twice. Errors are distances across the ray, seen from its origin.
"""

from __future__ import annotations

import functools
from typing import Any

import drjit as dr
import numpy as np
import pytest
from numpy.typing import NDArray

from nigemizu import field, trace

FloatArray = NDArray[np.float64]

VOLUMES = (field.TrilinearVolume, field.StratifiedVolume, field.TricubicVolume)
ACCURACIES = 10.0 ** -np.arange(4.0, 8.0)
RAYS = 60
ROUNDING = {"single": 1.6e-5, "double": 0.0}  # m: two spacings of single coordinates at 100 m


@functools.cache
def mesh(seed: int, coarse: bool) -> tuple[FloatArray, ...]:
    """Axes of uneven cells and a smooth random refractivity over a hot ground; about 100 × 28 × 15 m."""
    rng = np.random.default_rng(np.random.SeedSequence([7, seed]))
    across, down, growth = (10, 6, 1.35) if coarse else (25, 12, 1.12)
    x = np.concatenate([[0.0], np.cumsum(np.exp(rng.normal(0, 0.3, across)))])
    y = np.concatenate([[0.0], np.cumsum(np.exp(rng.normal(0, 0.3, down)))])
    x, y = x * (100 / x[-1]), y * (28 / y[-1]) - 14
    z = np.concatenate([[0.0], np.cumsum((0.1 if coarse else 0.02) * growth ** np.arange(60))])
    z = z[: 1 + np.searchsorted(z, 15)]
    Z, Y, X = np.meshgrid(z, y, x, indexing="ij")
    air = 2.7e-4 - 2e-5 * np.exp(-Z / 0.5)
    for wave in range(6):
        kx, ky = rng.normal(size=2) * (0.12, 0.25)
        swing = rng.normal() * np.sin(kx * X + ky * Y + rng.uniform(0, 2 * np.pi))
        air = air + 2e-6 * swing * np.exp(-Z / rng.uniform(0.3, 2.0)) * (1 if wave else 0.3)
    return x, y, z, air


def rays(seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Origins, directions and lengths: a third grazes, a third comes from anywhere, a third waits outside.

    All end within the volume: the fixed step in which a ray leaves is wrong by itself.
    """
    x, y, z, _ = mesh(seed, True)
    rng = np.random.default_rng(np.random.SeedSequence([11, seed]))
    lower, upper = np.array([x[0], y[0], 0.0]), np.array([x[-1], y[-1], min(z[-1], 12.0)])
    third = RAYS // 3
    origin = rng.uniform(lower, upper, (RAYS, 3))
    azimuth, elevation = rng.uniform(0, 2 * np.pi, RAYS), rng.uniform(-0.5, 0.5, RAYS)
    origin[: 2 * third, 2] = rng.uniform(0.35, 0.9, 2 * third)
    elevation[: 2 * third] = rng.uniform(-0.004, 0.01, 2 * third)
    ahead = slice(third, 2 * third)
    origin[ahead, 0], origin[ahead, 1] = -20.0, rng.uniform(-4, 4, third)
    azimuth[ahead] = rng.uniform(-0.05, 0.05, third)
    level = np.cos(elevation)
    direction = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)
    sides = np.where(direction > 0, upper, lower)
    sides[: 2 * third, 2] = np.where(direction[: 2 * third, 2] > 0, 1e9, -1e9)  # these turn, or rise
    length = 0.95 * ((sides - origin) / direction).min(axis=1)
    return origin, direction, length


def march(volume: Any, precision: Any, seed: int, coarse: bool, **options: Any) -> trace.RayEnd:
    types = field.types("llvm", precision)
    # Opaque: one kernel for all accuracies.
    options = {k: v if k == "stepper" else dr.opaque(types.Float, v) for k, v in options.items()}
    origin, direction, length = rays(seed)
    return trace.march(
        volume(*mesh(seed, coarse), types),
        types.Array3f(np.ascontiguousarray(origin.T)),
        types.Array3f(np.ascontiguousarray(direction.T)),
        max_steps=200_000,
        max_distance=types.Float(length),
        **options,
    )


def position(end: trace.RayEnd) -> FloatArray:
    assert np.all(np.array(end.status) == trace.STOPPED)
    return np.array(end.position, dtype=np.float64)


def apart(first: FloatArray, second: FloatArray, seed: int) -> FloatArray:
    """Distance across the straight ray, as an angle seen from the origin."""
    _, direction, length = rays(seed)
    offset = (first - second).T
    offset -= (offset * direction).sum(axis=1, keepdims=True) * direction
    return np.linalg.norm(offset, axis=1) / np.maximum(length, 1)


@functools.cache
def oracle(volume: Any, seed: int, coarse: bool) -> tuple[FloatArray, float]:
    """Ends by equal steps of 2 mm, and what doubling them changes, doubled."""
    fine, half = (
        position(march(volume, "double", seed, coarse, step=step, stepper=trace.LEAPFROG))
        for step in (0.002, 0.004)
    )
    assert np.all(fine[2] > 0)
    return fine, 2 * float(apart(fine, half, seed).max())


@pytest.mark.parametrize("coarse", [False, True], ids=["fine", "coarse"])
@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("volume", VOLUMES, ids=lambda volume: volume.__name__)
def test_controlled_steps_against_brute_force(volume: Any, precision: Any, coarse: bool) -> None:
    for seed in (1, 2):
        exact, own = oracle(volume, seed, coarse)
        assert own < {field.TrilinearVolume: 1e-7, field.StratifiedVolume: 1e-8}.get(volume, 1e-9)
        straight = rays(seed)[0] + rays(seed)[1] * rays(seed)[2][:, None]
        assert apart(straight.T, exact, seed).max() > 5e-4  # the air bends them
        steps = []
        for accuracy in ACCURACIES:
            end = march(volume, precision, seed, coarse, accuracy=accuracy)
            errors = apart(position(end), exact, seed)
            rounding = ROUNDING[precision] / np.maximum(rays(seed)[2], 1)
            # Seldom more than a tenth of it; where few large cells are crossed in many steps, all of it.
            within = (1.0 if accuracy > 3e-7 else 2.0) * accuracy
            if coarse and volume is field.TrilinearVolume:
                # A step may touch a face, seen from the side, that its straight line just misses: there the
                # gradient jumps and the estimate does not see it (5.9e-7 rad in one ray of 120).
                within = max(within, 1e-6)
            assert np.all(errors <= within + own + rounding)
            steps.append(float(np.mean(np.array(end.steps))))
        assert steps[0] < 60  # the oracle takes up to 60 000
        assert np.all(np.diff(steps) >= -0.5)
        if coarse and volume is field.TricubicVolume:  # where cells do not decide, the accuracy does
            assert steps[-1] > 1.3 * steps[0]


@pytest.mark.parametrize("volume", VOLUMES, ids=lambda volume: volume.__name__)
def test_steps_of_a_cell_each_would_be_seen(volume: Any) -> None:
    """Negative control: equal steps of 4 m, as long as the mean cell, miss what the controlled ones keep."""
    exact, own = oracle(volume, 1, False)
    long = march(volume, "double", 1, False, step=4.0, stepper=trace.LEAPFROG)
    assert apart(position(long), exact, 1).max() > 2e-6 + own
    controlled = march(volume, "double", 1, False, accuracy=1e-6)
    assert apart(position(controlled), exact, 1).max() < 2e-7 + own
    assert np.mean(np.array(controlled.steps)) < 4 * np.mean(np.array(long.steps))
