"""Bands of light, the Sun's and the Moon's colours, and what screens can show."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nigemizu.air.extinction import Extinction, rayleigh_optical_depth
from nigemizu.errors import InputError
from nigemizu.render import sun
from nigemizu.render.spectrum import LUMINANCE, bands, into_gamut, matching_functions

NM = 1e-9
FINE = np.arange(380, 780.5, 1.0) * NM
PRIMARIES = np.array([[0.4124, 0.3576, 0.1805], LUMINANCE, [0.0193, 0.1192, 0.9505]])


def chromaticity(rgb):
    xyz = np.asarray(rgb) @ PRIMARIES.T
    return xyz[..., :2] / xyz.sum(axis=-1, keepdims=True)


def test_matching_functions_make_equal_energy_white() -> None:
    """Integrals of the CIE 1931 functions: 106.857, equal to each other within 1e-4 (CIE 015)."""
    total = np.trapezoid(matching_functions(FINE), FINE / NM)
    np.testing.assert_allclose(total, 106.857, rtol=3e-4)
    assert FINE[np.argmax(matching_functions(FINE)[1])] == pytest.approx(555 * NM)


@pytest.mark.parametrize(
    ("temperature", "x", "y"),
    [(2855.54, 0.44758, 0.40745), (5000.0, 0.3451, 0.3516), (6500.0, 0.3135, 0.3237)],
)
def test_matching_functions_place_black_bodies(temperature: float, x: float, y: float) -> None:
    """Standard illuminant A (CIE 015), and the Planckian locus (Wyszecki and Stiles, Color Science, 1982)."""
    body = FINE**-5 / np.expm1(1.4388e-2 / (FINE * temperature))
    xyz = np.trapezoid(matching_functions(FINE) * body, FINE)
    np.testing.assert_allclose(xyz[:2] / xyz.sum(), [x, y], atol=2e-4)


def test_single_bands_have_the_hues_of_the_spectrum() -> None:
    """Violet, green, red: along the spectral locus one goes once, clockwise, round the Sun's white."""
    taken = bands(32)
    seen = taken.wavelength < 690 * NM  # beyond, red stays the same
    white = chromaticity(taken.rgb(np.ones(len(taken))))
    way = chromaticity(taken.to_rgb[seen]) - white
    angle = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    inner = slice(2, None)  # violet, too, stays the same up to 420 nm
    assert np.all(np.diff(angle[inner]) < 1e-3)
    assert np.pi < angle[2] - angle[-1] < 2 * np.pi
    assert [int(np.argmax(taken.to_rgb[np.argmin(np.abs(taken.wavelength - light * NM))]))
            for light in (450, 530, 620)] == [2, 1, 0]  # fmt: skip


def test_a_smooth_spectrum_needs_no_more_than_sixteen_bands() -> None:
    """λ⁻⁴, λ⁴: 16 bands against 64 within 0.5 %, and 4 bands are not enough."""

    def shown(count: int, power: int):
        taken = bands(count)
        return taken.rgb((taken.wavelength / (550 * NM)) ** power)

    for power in (-4, 4):
        np.testing.assert_allclose(shown(16, power), shown(64, power), rtol=0.005)
        assert np.abs(shown(4, power) / shown(64, power) - 1).max() > 0.01


def test_sunlight_has_luminance_one_and_the_colour_of_the_sun() -> None:
    """Chromaticity of the Sun outside the air: 5 770 K to 5 900 K, x = 0.322 to 0.327, y = 0.331 to 0.336."""
    for count in (4, 16, 64):
        taken = bands(count)
        assert len(taken) == count
        white = taken.rgb(np.ones(count))
        assert white @ LUMINANCE == pytest.approx(1.0, rel=1e-12)
        x, y = chromaticity(white)
        assert 0.320 < x < 0.328
        assert 0.329 < y < 0.337
        assert np.all(np.diff(taken.wavelength) > 0)


@pytest.mark.parametrize("mass", [0.0, 1.0, 10.0, 38.0])
def test_sixteen_bands_show_the_colours_of_a_fine_spectrum(mass: float) -> None:
    """The Sun through 0, 1, 10 and 38 (the horizon) air masses of molecules and ozone."""

    def shown(count: int):
        taken = bands(count)
        depth = rayleigh_optical_depth(taken.wavelength) + Extinction().ozone_optical_depth(taken.wavelength)
        return taken.rgb(np.exp(-mass * depth))

    coarse, fine = shown(16), shown(128)
    np.testing.assert_allclose(coarse @ LUMINANCE, fine @ LUMINANCE, rtol=0.02)
    np.testing.assert_allclose(chromaticity(coarse), chromaticity(fine), atol=0.003)
    if mass == 38.0:  # four bands are too few for that
        assert np.abs(chromaticity(shown(4)) - chromaticity(fine)).max() > 0.006


def test_mixing_leaves_colours_alone() -> None:
    for count in (4, 16, 128):
        taken = bands(count)
        np.testing.assert_allclose(taken.mixing.sum(axis=0), np.eye(3), atol=1e-12)
    # grey takes of each band what sunlight has of it, up to white balance
    taken = bands()
    grey = taken.mixing @ np.ones(3)
    np.testing.assert_allclose(grey, taken.to_rgb / taken.to_rgb.sum(axis=0), atol=1e-12)
    # red things are mostly seen in long waves, blue ones in short ones
    red, blue = (np.abs(taken.mixing @ colour).sum(axis=1) for colour in np.eye(3)[[0, 2]])
    assert np.average(taken.wavelength, weights=red) > 590 * NM
    assert np.average(taken.wavelength, weights=blue) < 480 * NM


def test_into_gamut() -> None:
    colours = np.random.default_rng(3).normal(0.3, 0.5, (500, 3))
    shown = into_gamut(colours)
    assert shown.min() == 0.0
    inside = colours.min(axis=1) >= 0
    np.testing.assert_array_equal(shown[inside], colours[inside])
    bright = colours @ LUMINANCE > 0
    np.testing.assert_allclose((shown @ LUMINANCE)[bright], (colours @ LUMINANCE)[bright], rtol=1e-12)
    np.testing.assert_array_equal(shown[~bright & ~inside], 0.0)
    # the hue stays: the three lie on a line with grey
    outside = bright & ~inside
    grey = (colours @ LUMINANCE)[outside, None]
    np.testing.assert_allclose(np.cross(shown[outside] - grey, colours[outside] - grey), 0.0, atol=1e-12)


def test_solar_irradiance() -> None:
    """Power and illuminance outside the air: 47 % to 48.5 % of 1 361 W/m² is visible, and 133.8 klx."""
    power = np.trapezoid(sun.solar_irradiance(FINE), FINE / NM)
    assert power == pytest.approx(650.0, rel=0.015)
    # solar illuminance constant of the IES, 127.5 klx, to that of CIE 110-1994, 133.8 klx
    lux = 683 * np.trapezoid(sun.solar_irradiance(FINE) * matching_functions(FINE)[1], FINE / NM)
    assert lux == pytest.approx(133.8e3, rel=0.01)


@pytest.mark.parametrize("wavelength", [430, 500, 550, 600, 680])
def test_limb_darkening_against_a_second_fit(wavelength: int) -> None:
    """μ^α, α = −0.023 + 0.292/λ: D. Hestroffer, C. Magnan, Astron. Astrophys. 333 (1998) 338.

    With one parameter it is too dark near the limb: the inner 92 % of the radius are compared.
    """
    mu = np.linspace(0.4, 1, 40)
    shown = sun.limb_darkening(mu, wavelength * NM)[0]
    alpha = -0.023 + 292.0 / wavelength
    np.testing.assert_allclose(shown / shown[-1], mu**alpha, atol=0.025)
    assert np.abs(shown / shown[-1] - mu ** (alpha + 0.15)).max() > 0.04


def test_limb_darkening_has_mean_one_and_no_seam() -> None:
    mu, weight = np.polynomial.legendre.leggauss(20)
    mu, weight = (mu + 1) / 2, weight / 2
    light = bands().wavelength
    np.testing.assert_allclose((sun.limb_darkening(mu, light) * 2 * mu * weight).sum(axis=1), 1.0, rtol=1e-12)
    below, above = sun.limb_darkening(mu, [422.56 * NM, 422.58 * NM])
    np.testing.assert_allclose(below, above, atol=0.02)


def test_the_disc_of_the_sun_lights_a_white_surface_to_one() -> None:
    """∫ L cos θ dω over the disc, over π, is 1: mean radiance times sin² of the radius."""
    s, weight = np.polynomial.legendre.leggauss(400)
    s, weight = (s + 1) / 2, weight / 2
    disc = sun.sun_radiance(s, [550 * NM])[0]
    assert (disc * 2 * s * weight).sum() * math.sin(sun.SUN_RADIUS) ** 2 == pytest.approx(1.0, rel=1e-4)
    assert disc[0] > 2 * disc[-1]


def test_moon() -> None:
    """Full Moon −12.73 mag by the phase law alone (Krisciunas and Schaefer 1991), Sun −26.74."""
    v = float(sun.moon_radiance(550 * NM, 0.0)) / 1.35
    assert v * math.sin(sun.MOON_RADIUS) ** 2 == pytest.approx(10 ** (-0.4 * 14.01), rel=0.03, abs=0)
    blue, green = sun.moon_radiance(np.array([440, 550]) * NM, 0.5)
    assert -2.5 * math.log10(blue / green) == pytest.approx(0.27, abs=1e-9)
    # at half Moon 2.602 mag less light (phase law); of the ball by Lommel and Seeliger 0.3768 is left
    assert float(sun.moon_radiance(550 * NM, math.pi / 2)) / 0.12 == pytest.approx(0.242, abs=0.002)
    phases = [float(sun.moon_radiance(550 * NM, angle)) for angle in np.linspace(0, math.pi, 50)]
    assert np.all(np.diff(phases) <= 1e-12)


def test_light_of_the_whole_ball() -> None:
    """The sum of 2μ₀/(μ₀ + μ) over the disc is the factor by which the radiance was divided."""
    axis = (np.arange(1200) + 0.5) / 600 - 1
    x, y = np.meshgrid(axis, axis)
    rise = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    for angle in (0.3, 1.2, 2.2):
        incident = np.maximum(x * math.sin(angle) + rise * math.cos(angle), 0)
        shown = np.where(rise > 0, 2 * incident / np.maximum(incident + rise, 1e-9), 0)
        light = shown.sum() * (axis[1] - axis[0]) ** 2 / math.pi
        assert sun._ball(angle) == pytest.approx(light, rel=3e-3, abs=0)


@pytest.mark.parametrize(
    "call",
    [
        lambda: bands(3),
        lambda: bands(500),
        lambda: sun.solar_irradiance(900e-9),
        lambda: sun.limb_darkening([1.5], 550e-9),
        lambda: sun.limb_darkening([0.5], 300e-9),
        lambda: sun.sun_radiance([1.2], 550e-9),
        lambda: sun.moon_radiance(550e-9, 4.0),
        lambda: sun.moon_radiance(550.0),
    ],
)
def test_what_is_refused(call) -> None:
    with pytest.raises(InputError):
        call()
