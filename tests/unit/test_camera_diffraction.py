"""Diffraction at a round aperture against closed forms and a brute-force integral."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import j1

from nigemizu.render import diffract
from nigemizu.render.diffraction import transfer


def spread_point(size: int, scale: float) -> np.ndarray:
    """A bright pixel in the middle of an odd picture, after diffraction."""
    picture = np.zeros((size, size, 1), dtype=np.float32)
    picture[size // 2, size // 2] = 1.0
    return diffract(picture, [scale])[..., 0].astype(float)


def airy(radius: np.ndarray, scale: float) -> np.ndarray:
    """Intensity per unit area of unit power: (π/4)(2 J₁(v)/v)² / (λN)², v = π r / (λN)."""
    v = np.maximum(np.pi * radius / scale, 1e-12)
    return np.pi / 4 / scale**2 * (2 * j1(v) / v) ** 2


def test_rings_of_the_airy_pattern() -> None:
    """Born and Wolf (1999), §8.5.2, table 8.2: first dark ring at 1.220 λN, next bright one at 1.635 λN with
    1.75 % of the intensity in the middle; 83.8 % of the light falls within the first dark ring."""
    scale, size = 24.0, 801
    pattern = spread_point(size, scale)
    row = pattern[size // 2, size // 2 :]
    dark = 20 + np.argmin(row[20:36])
    bright = 32 + np.argmax(row[32:50])
    assert 1.220 * scale - 0.6 < dark < 1.220 * scale + 0.6
    assert 1.635 * scale - 0.9 < bright < 1.635 * scale + 0.9
    assert 0.0172 < row[bright] / row[0] < 0.0178
    assert row[0] == pytest.approx(np.pi / 4 / scale**2, rel=3e-3)
    y, x = np.mgrid[:size, :size] - size // 2
    inside = pattern[np.hypot(x, y) < 1.220 * scale].sum()
    assert 0.836 < inside < 0.841
    # Negative control: another wavelength, a tenth longer, has its dark ring elsewhere.
    longer = spread_point(size, 1.1 * scale)[size // 2, size // 2 :]
    assert 20 + np.argmin(longer[20:40]) > 1.220 * scale + 2


@pytest.mark.parametrize("scale", [0.45, 0.7, 1.3, 3.0])
def test_pixels_hold_the_integral_of_the_pattern(scale: float) -> None:
    """Against the Airy function summed over 200×200 places of each pixel, undersampled ones too."""
    pattern = spread_point(257, scale)
    fine = (np.arange(200) + 0.5) / 200 - 0.5
    for i, j in ((0, 0), (0, 1), (1, 1), (2, 0), (3, 2)):
        x, y = np.meshgrid(i + fine, j + fine)
        expected = airy(np.hypot(x, y), scale).mean()
        # Of all light 2e-5 a pixel comes back from the mirrored edges at most.
        assert pattern[128 + j, 128 + i] == pytest.approx(expected, rel=2e-3, abs=2e-5)


def test_modulation_transfer_in_closed_form() -> None:
    """At half the cut-off (2/π)(arccos ½ − ½√¾) = 0.391 (Goodman 2005, eq. 6-32) is left of a sine, times
    sinc(f) for the pixels; behind the cut-off nothing."""
    scale, width = 4.0, 64
    for cycles, modulation in ((0.125, 0.3910), (0.0625, 0.6850), (0.25, 0.0), (0.4375, 0.0)):
        wave = np.cos(2 * np.pi * cycles * (np.arange(width) + 0.5))
        picture = np.broadcast_to(1 + 0.5 * wave[None, :, None], (8, width, 1)).astype(np.float32)
        left = diffract(picture, [scale])[..., 0] - 1
        gain = float((left * wave).sum() / (0.5 * wave * wave).sum() / 8)
        assert gain == pytest.approx(modulation * np.sinc(cycles), abs=2e-4)


@pytest.mark.parametrize("shape", [(40, 60), (31, 7), (1, 1)])
def test_no_light_is_lost_nor_made(shape: tuple[int, int]) -> None:
    random = np.random.default_rng(5).exponential(size=(*shape, 3)).astype(np.float32)
    random[0, 0] = 1e4  # in the corner, where most could leave
    blurred = diffract(random, [0.35, 2.0, 9.0])
    np.testing.assert_allclose(
        blurred.sum(axis=(0, 1), dtype=float), random.sum(axis=(0, 1), dtype=float), rtol=1e-6
    )
    assert blurred.min() >= 0
    even = np.full((*shape, 3), 0.7, dtype=np.float32)
    np.testing.assert_allclose(diffract(even, [0.6, 2.0, 9.0]), even, rtol=1e-6)


def test_a_point_stays_where_it_is_and_each_colour_has_its_size() -> None:
    picture = np.zeros((41, 61, 3), dtype=np.float32)
    picture[12, 40] = 1.0
    blurred = diffract(picture, [3.0, 2.5, 2.0])
    for channel in range(3):
        assert np.unravel_index(blurred[..., channel].argmax(), (41, 61)) == (12, 40)
    np.testing.assert_allclose(blurred[12, 41:45], blurred[12, 39:35:-1], rtol=0.02)
    assert blurred[12, 40, 0] < blurred[12, 40, 1] < blurred[12, 40, 2]


@pytest.mark.parametrize("scale", [0.39, 0.3, 0.11])
def test_many_frequencies_that_look_alike_are_summed_quickly(scale: float) -> None:
    """The polynomial against the sum itself."""
    f, g, reach = np.arange(31) / 60, np.arange(21)[:, None] / 40, int(1 / scale) + 2
    expected = np.zeros((21, 31))
    for a in range(-reach, reach + 1):
        for b in range(-reach, reach + 1):
            s = np.minimum(np.hypot(f + a, g + b) * scale, 1)
            expected += 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)) * np.sinc(f + a) * np.sinc(g + b)
    np.testing.assert_allclose(transfer(20, 30, scale), expected, atol=3e-6)
    assert expected[-1, -1] < 0.95


def test_transfer_is_one_for_even_light() -> None:
    for scale in (1e-6, 0.2, 0.35, 1.0, 7.0):
        assert transfer(5, 9, scale)[0, 0] == pytest.approx(1.0, abs=1e-14)
        assert transfer(5, 9, scale).max() <= 1 + 1e-6
