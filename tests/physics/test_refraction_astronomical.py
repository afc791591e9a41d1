"""Astronomical refraction against published numbers, closed forms and programs of others.

Where a number was computed for this test by another program, the air and the rounding of its result stand
beside it; published numbers carry their source.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from nigemizu import trace
from nigemizu.air import refractivity
from nigemizu.air.hohenkerk_sinclair import HohenkerkSinclair

FloatArray = NDArray[np.float64]

R = 6371e3
SECOND = np.pi / 180 / 3600
MINUTE = np.pi / 180 / 60


class Polytropes:
    """Ideal gas at rest in layers of constant lapse rate, of which n − 1 is a multiple of the density."""

    def __init__(
        self,
        surface: float | FloatArray,
        bases: list[float],
        temperatures: list[float],
        fall: float,
        *,
        top: float,
        geopotential: float = np.inf,
    ) -> None:
        """`fall` is g M/R [K/m]; `geopotential` the radius of the heights of layers, if they are such."""
        self.surface, self.fall, self.top, self.round = surface, fall, top, geopotential
        self.bases, self.warmth = np.array(bases), np.array(temperatures)
        self.lapse = np.append(np.diff(self.warmth) / np.diff(self.bases), 0.0)
        self.logs = np.zeros(len(bases))
        for layer, (low, high) in enumerate(pairwise(bases)):
            self.logs[layer + 1] = self.logs[layer] + self._fallen(np.asarray(layer), np.asarray(high - low))
        self.breaks = tuple(
            h if np.isinf(geopotential) else geopotential * h / (geopotential - h) for h in bases[1:]
        )

    def _fallen(self, layer: NDArray[np.intp], rise: FloatArray) -> FloatArray:
        """ln of the density less that at the base."""
        lapse, base = self.lapse[layer], self.warmth[layer]
        still = lapse == 0
        safe = np.where(still, 1.0, lapse)
        return np.where(
            still, -self.fall * rise / base, -(self.fall / safe + 1) * np.log1p(lapse * rise / base)
        )

    def __call__(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        height = np.asarray(height, dtype=np.float64)
        stretch = 1 / (1 + height / self.round)
        level = height * stretch
        layer = np.clip(np.searchsorted(self.bases, level, side="right") - 1, 0, len(self.bases) - 1)
        rise = level - self.bases[layer]
        excess = self.surface * np.exp(self.logs[layer] + self._fallen(layer, rise))
        warmth = self.warmth[layer] + self.lapse[layer] * rise
        return excess, -(self.fall + self.lapse[layer]) / warmth * stretch**2 * excess


def standard_air(surface: float | FloatArray) -> Polytropes:
    """US Standard Atmosphere 1976 to 86 km, dry, with n − 1 at the surface (288.15 K, 101 325 Pa)."""
    bases = [0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3, 84852.0]
    warmth = [288.15, 216.65, 216.65, 228.65, 270.65, 270.65, 214.65, 186.946]
    fall = 9.80665 * 28.9644 / 8314.32
    return Polytropes(surface, bases, warmth, fall, top=86e3, geopotential=6356766.0)


def exponential(height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """n = 1 + 2.9e-4 exp(−h/8 km)."""
    excess = 2.9e-4 * np.exp(-height / 8000.0)
    return excess, -excess / 8000.0


def vacuum(height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """No air."""
    return 0.0 * height, 0.0 * height


def test_slalib_refro() -> None:
    """0.00106715763018568 rad: the test of sla_REFRO in SLALIB (P. T. Wallace), to a precision of 1e-9.

    Its Simpson rule, stopped there, is 1.45e-12 below its own limit; so is the number below ours.
    """
    air = HohenkerkSinclair(
        280.0,
        67890.0,
        relative_humidity=0.9,
        wavelength=0.55e-6,
        observer_height=3456.7,
        latitude=-0.3,
        lapse_rate=0.006,
    )
    lifted = trace.astronomical_refraction(
        air, np.pi / 2 - 1.4, radius=air.radius, observer_height=3456.7, tolerance=1e-14
    )
    assert lifted == pytest.approx(0.00106715763018568, rel=0, abs=1e-11)
    # a 40-point Gauss rule in each layer, by another program
    assert lifted == pytest.approx(0.001067157631634, rel=0, abs=2e-15)


def test_the_table_of_erfa_refco() -> None:
    """The column of ray tracing in the header of refco.c (ERFA, from IAU SOFA's refco.for)."""
    air = HohenkerkSinclair(
        280.15,
        100500.0,
        relative_humidity=0.8,
        wavelength=0.574e-6,
        latitude=np.radians(50),
        lapse_rate=0.0065,
    )
    zenith = np.array([10, 20, 30, 40, 45, 50, 55, 60, 65, 70, 72, 74, 76, 78, 80])
    table = np.array(
        [
            10.27,
            21.19,
            33.61,
            48.82,
            58.16,
            69.28,
            82.97,
            100.51,
            124.23,
            158.63,
            177.32,
            200.35,
            229.45,
            267.44,
            319.13,
        ]
    )
    lifted = trace.astronomical_refraction(air, np.radians(90.0 - zenith), radius=air.radius) / SECOND
    assert np.all(np.abs(lifted - table) < 0.07)
    np.testing.assert_allclose(lifted[2:], table[2:], rtol=3e-4, atol=0)
    dry = HohenkerkSinclair(280.15, 100500.0, wavelength=0.574e-6, latitude=np.radians(50))
    without = trace.astronomical_refraction(dry, np.radians(20.0), radius=dry.radius) / SECOND
    assert abs(without - 158.63) > 0.07  # so that the vapour counts


def test_standard_atmosphere() -> None:
    """590 nm, by a quadrature of another program, which lets n fall to 1 at 86 km."""
    elevation = np.radians([0, 0.25, 0.5, 1, 2, 3, 5, 10, 15, 20, 30, 45, 60])
    expected = np.array(
        [
            1975.249486066035,
            1803.972963079187,
            1654.6991763362594,
            1408.8799392552091,
            1064.3438190141853,
            840.838187467242,
            578.3606143351593,
            312.5375207263982,
            209.68964122717333,
            155.47902490659501,
            98.53124594860135,
            57.02044056557313,
            32.946656685653686,
        ]
    )
    air = standard_air(2.7713629991e-4)
    lifted = trace.astronomical_refraction(air, elevation, radius=R) / SECOND
    assert np.all(np.abs(lifted - expected) < 0.01)
    whole = trace.astronomical_refraction(air, elevation, radius=R, into_vacuum=True) / SECOND
    np.testing.assert_allclose(whole, expected, rtol=1e-7, atol=0)
    # what the last step adds is (n − 1) tan z of the air at 86 km, within what the sphere takes from it
    left = float(air(np.asarray(86e3))[0])
    assert (whole - lifted)[-1] == pytest.approx(left / np.tan(np.radians(60)) / SECOND, rel=0.03, abs=0)


def test_dispersion_at_the_horizon() -> None:
    """The same air at nine wavelengths in one call; Ciddor's law at the surface, by another program."""
    wavelength = np.array([0.4, 0.45, 0.486, 0.5, 0.55, 0.589, 0.65, 0.656, 0.7]) * 1e-6
    air = standard_air(refractivity(288.15, 101325.0, wavelength=wavelength))
    elevation = np.radians([0, 0.5, 5, 10, 45])
    lifted = trace.astronomical_refraction(air, elevation, radius=R) / SECOND
    assert lifted.shape == (5, 9)
    expected = np.array(
        [
            2018.8648601914251,
            2001.568251926428,
            1992.4692868860873,
            1989.4784544665588,
            1980.6783596608257,
            1975.371373663529,
            1968.9651902591813,
            1968.4326222504958,
            1964.9470959357168,
        ]
    )
    assert np.all(np.abs(lifted[0] - expected) < 0.01)
    spread = [53.917764255708335, 44.371249, 14.702246, 7.877514, 1.43166]
    np.testing.assert_allclose(lifted[:, 0] - lifted[:, -1], spread, rtol=1e-4, atol=0)
    alone = standard_air(float(refractivity(288.15, 101325.0, wavelength=wavelength[3])))
    single = trace.astronomical_refraction(alone, elevation, radius=R) / SECOND
    np.testing.assert_allclose(single, lifted[:, 3], rtol=1e-10, atol=0)


def test_power_law_sphere() -> None:
    """n = n₀ (R/r)^0.15 from the horizon to 100 km: m/(1 − m) times the change of the zenith distance."""
    for start in (1.0003, 1.0, 1.3):

        def air(height: FloatArray, start: float = start) -> tuple[FloatArray, FloatArray]:
            n = start * np.exp(-0.15 * np.log1p(height / R))
            return n - 1, -0.15 * n / (R + height)

        lifted = trace.astronomical_refraction(air, 0.0, radius=R, top=100e3, tolerance=1e-14)
        assert lifted == pytest.approx(0.028651094953813436, rel=0, abs=1e-13)


def test_exponential_sphere() -> None:
    """By a quadrature of another program, within 1e-8″; the looser tolerances keep their word."""
    zenith = np.array([30, 60, 75, 80, 85, 88, 89, 89.5, 90])
    expected = np.array(
        [
            34.47928647314355,
            103.13641009317509,
            219.68337408933522,
            327.9245715598372,
            611.4754644707245,
            1158.045511112054,
            1579.4824037936658,
            1901.9756750989625,
            2354.1229961355975,
        ]
    )
    elevation = np.radians(90.0 - zenith)
    for tolerance in (1e-5, 1e-7, 1e-9, 1e-12):
        lifted = trace.astronomical_refraction(
            exponential, elevation, radius=R, top=480e3, tolerance=tolerance
        )
        assert np.all(np.abs(lifted - expected * SECOND) < max(tolerance, 5e-14))
    lifted = trace.astronomical_refraction(exponential, elevation, radius=R, top=480e3, tolerance=1e-14)
    assert np.all(np.abs(lifted / SECOND - expected) < 1e-8)


def test_the_two_forms_of_the_integral_agree() -> None:
    """Refraction = geocentric angle − change of the local elevation, which the invariant gives by itself."""
    air = standard_air(2.7713629991e-4)
    elevation = np.radians([-0.9, -0.3, 0, 1e-6, 0.05, 1, 3.3, 3.5, 8, 30, 89, 90])
    rays = trace.refracted_rays(air, elevation, radius=R, observer_height=1000.0, tolerance=1e-13)
    here, over = (float(air(np.asarray(h))[0]) for h in (1000.0, 86e3))
    climb = np.log1p((over - here) / (1 + here)) + np.log1p(85e3 / (R + 1000.0))
    leaving = np.arccos(np.cos(elevation) * np.exp(-climb))
    np.testing.assert_allclose(
        rays.geocentric_angle - (leaving - elevation), rays.refraction, rtol=0, atol=2e-14
    )
    np.testing.assert_allclose(rays.true_elevation + rays.refraction, elevation, rtol=0, atol=1e-16)
    assert rays.refraction[-1] == pytest.approx(0, rel=0, abs=1e-19)  # straight up
    assert rays.path_length[-1] == pytest.approx(85e3, rel=1e-12, abs=0)


# A. T. Young, Green flashes and mirages, Optics & Photonics News 10 (3) (1999) 31: the profile of his sunset
# over warm water. The numbers are by another program, with g = 9.80665 m/s² and R = 8.314462618 J/(mol K).
YOUNG_HEIGHTS = [0, 0.8, 1.8, 2.7, 4, 5.9, 8.9, 18.1, 32.5, 50, 11000]
YOUNG_TEMPERATURES = [288, 287.5, 287.3, 287.2, 287.1, 287, 286.9, 286.7, 286.5, 286.3, 216]


def young() -> Polytropes:
    """Air of his sunset, isothermal above 11 km, at 0.7 µm."""
    molar, gas = 0.028964, 8.314462618
    surface = 2.871e-4 * (1 + 5.67e-3 / 0.7**2) / 1.29223 * 101325.0 * molar / (gas * 288)
    heights = [float(h) for h in YOUNG_HEIGHTS]
    return Polytropes(surface, heights, YOUNG_TEMPERATURES, 9.80665 * molar / gas, top=200e3)


def test_sunset_with_an_inferior_mirage() -> None:
    """Eye at 9.28 m: rays that turn within millimetres to metres of the sea, over kinks of the profile."""
    apparent = np.array([-5.4, -5.2, -5, -4, -3, -2, -1, 0, 1, 5, 10, 20, 30])
    expected = np.array(
        [
            29.572958523228195,
            29.923551085634156,
            30.295995753454093,
            31.24432761615823,
            31.779086839581442,
            31.90645159400823,
            32.1001662379189,
            32.025068324829164,
            31.935047760750738,
            31.448737268271273,
            30.686591444739342,
            29.061017626741027,
            27.494684869109197,
        ]
    )
    folds = np.array(
        [
            -5.120135356318896,
            -4.84709040679369,
            -4.483030474093416,
            -3.6638956255178,
            -3.481865659167663,
        ]
    )
    lifted = trace.astronomical_refraction(
        young(), apparent * MINUTE, radius=6378140.0, observer_height=9.28, tolerance=1e-11
    )
    near = np.min(np.abs(apparent[:, None] - folds), axis=1) < 0.15
    assert near.sum() == 2
    assert np.all(np.abs(lifted / MINUTE - expected) < np.where(near, 0.1, 0.001))
    # and in fact everywhere:
    assert np.all(np.abs(lifted / MINUTE - expected) < 2e-5)


def test_the_mirage_folds_the_sun() -> None:
    """Apparent elevations at which the true one turns: images are born there in pairs.

    Three of the five are rays that turn at a kink of the profile, which Bouguer's invariant knows exactly.
    The other program found the folds on a grid, to 0.04′.
    """
    air, eye, sphere = young(), 9.28, 6378140.0
    apparent = np.linspace(-5.5, -3.0, 5001)
    rays = trace.refracted_rays(air, apparent * MINUTE, radius=sphere, observer_height=eye)
    rising = np.diff(rays.true_elevation) > 0
    turns = apparent[1:-1][rising[1:] != rising[:-1]]
    folds = [-5.120135356318896, -4.84709040679369, -4.483030474093416, -3.6638956255178, -3.481865659167663]
    assert turns.shape == (5,)
    assert np.max(np.abs(turns - folds)) < 0.04
    here = float(air(np.asarray(eye))[0])
    for turn, kink in zip(turns[[0, 2, 4]], (2.7, 4.0, 5.9), strict=True):
        there = float(air(np.asarray(kink))[0])
        invariant = (1 + there) * (sphere + kink) / ((1 + here) * (sphere + eye))
        assert turn == pytest.approx(-np.arccos(invariant) / MINUTE, rel=0, abs=1e-3)


def test_the_horizon_of_the_mirage() -> None:
    """A hair below the grazing ray there is water."""
    seen = trace.horizon(young(), 9.28, radius=6378140.0)
    assert seen.dip / MINUTE == pytest.approx(7.23347996934547, rel=0, abs=1e-6)
    below = -seen.dip * np.array([1 - 1e-8, 1 + 1e-8])
    lost = trace.refracted_rays(young(), below, radius=6378140.0, observer_height=9.28)
    assert lost.status.tolist() == [trace.RefractionStatus.ESCAPED, trace.RefractionStatus.HIT]
    assert np.isnan(lost.refraction).tolist() == [False, True]


def test_air_mass_of_an_exponential_sphere() -> None:
    """Chapman's function for straight rays, H = 8 km (another program, adaptive quadrature)."""
    zenith = np.radians([60, 80, 85, 90])
    expected = [1.992576764804709, 5.5505200396358685, 10.140026354817039, 35.385319517709895]
    mass = trace.column(
        lambda h: np.exp(-h / 8e3) / 8e3, vacuum, np.pi / 2 - zenith, radius=R, top=400e3, tolerance=1e-11
    )
    np.testing.assert_allclose(mass, expected, rtol=1e-11, atol=0)
    # Chapman at the horizon: √(πx/2) (1 + 3/(8x) …), x = R/H
    x = R / 8e3
    assert mass[-1] == pytest.approx(np.sqrt(np.pi * x / 2) * (1 + 3 / (8 * x)), rel=1e-6, abs=0)


def test_zenith_delay_is_the_column_of_refractivity() -> None:
    """Straight up ∫ (n − 1) dh = 2.9e-4 · 8000 m (1 − e⁻⁶⁰)."""
    rays = trace.refracted_rays(exponential, np.pi / 2, radius=R, top=480e3, tolerance=1e-12)
    assert rays.excess_path == pytest.approx(2.32, rel=1e-9, abs=0)
