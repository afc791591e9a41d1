"""The noise of the sensor against the statistics of photons."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, norm

from nigemizu.render import Noise, add_noise


def electrons(level: float, noise: Noise, *, seed: int = 1, frame: int = 0) -> np.ndarray:
    picture = np.full((200, 200, 3), level, dtype=np.float32)
    return add_noise(picture, noise, seed=seed, frame=frame).astype(float).ravel() * noise.full_well


@pytest.mark.parametrize(
    ("level", "noise"),
    [
        (0.3, Noise(full_well=2000.0, read_noise=0.0)),
        (0.02, Noise(full_well=1000.0, read_noise=0.0)),
        (0.3, Noise(full_well=2000.0, read_noise=40.0)),
        (0.0, Noise(full_well=2000.0, read_noise=4.0)),
    ],
)
def test_variance_is_the_mean_number_of_electrons(level: float, noise: Noise) -> None:
    """Var = L W + r² (Poisson, and the read noise); χ² bounds of 10⁻⁵ on either side, and a mean as exact."""
    found = electrons(level, noise)
    mean, degrees = np.float32(level) * noise.full_well, found.size - 1
    variance = mean + noise.read_noise**2
    statistic = degrees * found.var(ddof=1) / variance
    low, high = chi2.ppf([1e-5, 1 - 1e-5], degrees)
    assert low < statistic < high
    assert abs(found.mean() - mean) < norm.ppf(1 - 1e-5) * np.sqrt(variance / found.size)
    # Negative control: five per cent more electrons would not pass.
    assert not low < statistic / 1.05 < high


def test_a_full_pixel_holds_no_more() -> None:
    noise = Noise(full_well=500.0, read_noise=0.0)
    assert electrons(3.0, noise).max() == pytest.approx(500.0)
    assert electrons(1e30, noise).min() == pytest.approx(500.0)
    # Half of the pixels at saturation would hold more.
    assert 0.45 < np.mean(electrons(1.0, noise) > 499.9) < 0.56


def test_frames_differ_and_repeat() -> None:
    noise = Noise()
    first = electrons(0.4, noise, seed=7, frame=3)
    np.testing.assert_array_equal(first, electrons(0.4, noise, seed=7, frame=3))
    for seed, frame in ((7, 4), (8, 3)):
        other = electrons(0.4, noise, seed=seed, frame=frame)
        assert abs(np.corrcoef(first, other)[0, 1]) < 5 / np.sqrt(first.size)


def test_colours_and_pixels_are_independent() -> None:
    picture = np.full((200, 200, 3), 0.5, dtype=np.float32)
    noisy = add_noise(picture, Noise(), seed=1, frame=0)
    for pair in ((noisy[..., 0], noisy[..., 1]), (noisy[:, 1:, 0], noisy[:, :-1, 0])):
        assert abs(np.corrcoef(pair[0].ravel(), pair[1].ravel())[0, 1]) < 5 / 200
