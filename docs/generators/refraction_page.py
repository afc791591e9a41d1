"""Refraction and extinction over a round Earth: published numbers against this version, at each build."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from generators import refraction_rays
from generators.figures import BLUE, RED, panels
from generators.text import table, write_if_changed
from generators.validation import Case, row_of
from nigemizu.air import (
    Atmosphere,
    Earth,
    HohenkerkSinclair,
    Profile,
    ProfileSpec,
    density,
    refractivity,
)
from nigemizu.air.extinction import ozone_cross_section, rayleigh_optical_depth
from nigemizu.trace import astronomical_refraction, column, horizon, refraction_coefficient

__all__ = ["write"]

RADIUS = 6_371_000.0
ARCSEC = math.radians(1 / 3600)
ARCMIN = math.radians(1 / 60)
US1976 = {
    0.0: 1975.249486066035,
    0.5: 1654.6991763362594,
    1.0: 1408.8799392552091,
    5.0: 578.3606143351593,
    10.0: 312.5375207263982,
    30.0: 98.53124594860135,
    60.0: 32.946656685653686,
}
YOUNG = {
    -5.4: 29.572958523228195,
    -5.0: 30.295995753454093,
    -4.0: 31.24432761615823,
    -3.0: 31.779086839581442,
    -2.0: 31.90645159400823,
    -1.0: 32.1001662379189,
    0.0: 32.025068324829164,
    1.0: 31.935047760750738,
    5.0: 31.448737268271273,
    10.0: 30.686591444739342,
    20.0: 29.061017626741027,
    30.0: 27.494684869109197,
}
YOUNG_NAMES = {-5.0: "−5′", 0.0: "0′", 30.0: "30′"}
REFCO = {
    10: 10.27, 20: 21.19, 30: 33.61, 40: 48.82, 45: 58.16, 50: 69.28, 55: 82.97, 60: 100.51,
    65: 124.23, 70: 158.63, 72: 177.32, 74: 200.35, 76: 229.45, 78: 267.44, 80: 319.13,
}  # fmt: skip
NIST = (
    (20, 101.325, 0, 633, 1.0002718), (20, 60, 0, 633, 1.000160924), (20, 120, 0, 633, 1.000321916),
    (50, 100, 0, 633, 1.000243285), (5, 100, 0, 633, 1.000282756), (-40, 100, 0, 633, 1.00033758),
    (50, 120, 100, 633, 1.000287924), (40, 120, 75, 633, 1.000299418), (20, 100, 100, 633, 1.000267394),
    (40, 110, 100, 1700, 1.000270247), (20, 101.325, 0, 1700, 1.000268479), (40, 110, 100, 300, 1.000289),
    (20, 101.325, 0, 300, 1.000286581), (-40, 120, 0, 300, 1.000427233),
)  # fmt: skip
"""°C, kPa, % of humidity, nm and n."""


class PowerLaw:
    """n = n₀ (R/r)^m between R and 100 km above it."""

    breaks: tuple[float, ...] = ()
    top = 100e3

    def __call__(self, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n = 1.3 * (RADIUS / (RADIUS + height)) ** 0.15
        return n - 1, -0.15 * n / (RADIUS + height)


class Exponential:
    """n = 1 + 2.9e-4 exp(−h/8 km)."""

    breaks: tuple[float, ...] = ()
    top = 480e3

    def __call__(self, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        less = 2.9e-4 * np.exp(-height / 8000)
        return less, -less / 8000


def write(path: Path, picture: Path) -> None:
    """The table, and how far quadrature and marched rays are from the published refraction."""
    cases = [*_air(), *_almanacs(), *_spheres(), *_standard(), *_sea(), *_sunset(), *_light()]
    marched, deviation = _marched()
    cases += [*marched, *refraction_rays.cases()]
    wrong = [case.what for case in cases if not abs(case.obtained - case.expected) <= case.allowed]
    if wrong:
        raise AssertionError(f"validation fails for {', '.join(wrong)}")
    header = ("case", "source", "expected", "obtained", "deviation", "allowed")
    write_if_changed(path, table(header, [row_of(case) for case in cases], (26, 26, 14, 14, 10, 10)))
    _draw(picture, deviation)


def _air() -> list[Case]:
    worst = max(
        (
            float(
                1
                + refractivity(
                    celsius + 273.15,
                    1e3 * pressure,
                    relative_humidity=humidity / 100,
                    wavelength=length * 1e-9,
                )
            )
            - n
            for celsius, pressure, humidity, length, n in NIST
        ),
        key=abs,
    )
    what = "n by Ciddor's law, worst of 14 states and colours of air"
    return [Case(what, "NIST Engineering Metrology Toolbox", 0.0, worst, 1e-9)]


def _almanacs() -> list[Case]:
    model = HohenkerkSinclair(
        280.0,
        67890.0,
        relative_humidity=0.9,
        wavelength=0.55e-6,
        observer_height=3456.7,
        latitude=-0.3,
        lapse_rate=0.006,
    )
    found = astronomical_refraction(
        model, math.pi / 2 - 1.4, radius=model.radius, observer_height=3456.7, tolerance=1e-13
    )
    cases = [
        Case(
            "refro: zenith distance 1.4 rad",
            "test suite of SLALIB and PAL",
            1.06715763018568e-3,
            float(found.ravel()[0]),
            1e-11,
            unit="rad",
        )
    ]
    air = HohenkerkSinclair(
        280.15,
        100500.0,
        relative_humidity=0.8,
        wavelength=0.574e-6,
        observer_height=0.0,
        latitude=math.radians(50),
        lapse_rate=0.0065,
    )
    zenith, expected = np.array(list(REFCO)), np.array(list(REFCO.values()))
    off = astronomical_refraction(air, np.radians(90.0 - zenith), radius=air.radius) / ARCSEC - expected
    worst = float(off[np.argmax(np.abs(off))])
    what = "ray trace of the almanacs, worst of 15 zenith distances, 10° to 80°"
    cases.append(Case(what, "ERFA, refco.c: 10.27″ to 319.13″", 0.0, worst, 0.07, unit="″"))
    return cases


def _spheres() -> list[Case]:
    power = float(astronomical_refraction(PowerLaw(), 0.0, radius=RADIUS, tolerance=1e-14).ravel()[0])
    level = float(astronomical_refraction(Exponential(), 0.0, radius=RADIUS, tolerance=1e-14).ravel()[0])
    straight = column(
        lambda height: np.exp(-height / 8000),
        lambda height: (0 * height, 0 * height),
        0.0,
        radius=RADIUS,
        top=480e3,
    )
    return [
        Case(
            "power-law sphere, level ray",
            "m/(1 − m) (z₀ − z₁), closed form",
            0.028651094953813436,
            power,
            1e-13,
            unit="rad",
        ),
        Case(
            "exponential sphere, level ray",
            "two quadratures, 22 digits",
            2354.1229961355975 * ARCSEC,
            level,
            1e-8 * ARCSEC,
            ARCSEC,
            "″",
        ),
        Case(
            "air mass of an exponential sphere, level",
            "Chapman, R/H e^(R/H) K₁(R/H)",
            35.385319517709895,
            float(np.ravel(straight)[0]) / 8000,
            35.4e-9,
        ),
    ]


def _in_proportion(wavelength: float) -> tuple[Profile, Atmosphere]:
    """The standard atmosphere with n − 1 in proportion to the density, Ciddor's at the ground."""
    ground = float(Atmosphere(wavelength=wavelength).refractivity(288.15, 101_325.0))
    constant = ground / float(density(288.15, 101_325.0))
    law = Atmosphere(model="gladstone-dale", gladstone_dale_constant=constant, wavelength=wavelength)
    return ProfileSpec(kind="us1976").build(Earth()), law


def _refraction(wavelength: float, apparent: float) -> float:
    profile, law = _in_proportion(wavelength)
    found = astronomical_refraction(profile.index(law), apparent, radius=RADIUS, into_vacuum=True)
    return float(found.ravel()[0])


def _standard() -> list[Case]:
    cases = [
        Case(
            f"U.S. standard of 1976, 590 nm, {apparent:g}° high",
            "quadrature and DOP853, two programs",
            expected * ARCSEC,
            _refraction(590e-9, math.radians(apparent)),
            0.01 * ARCSEC,
            ARCSEC,
            "″",
        )
        for apparent, expected in US1976.items()
    ]
    spread = _refraction(400e-9, 0.0) - _refraction(700e-9, 0.0)
    cases.append(
        Case(
            "dispersion at the horizon, 400 − 700 nm",
            "the same, Ciddor's dispersion",
            53.917764255708335 * ARCSEC,
            spread,
            0.01 * ARCSEC,
            ARCSEC,
            "″",
        )
    )
    return cases


def _sea() -> list[Case]:
    profile, law = _in_proportion(550e-9)
    index = profile.index(law)
    cases = []
    for height, dip in (
        (1.5, 2.149322397943376),
        (10.0, 5.549701226161147),
        (100.0, 17.55553306048125),
        (1000.0, 55.69652812717193),
    ):
        found = float(horizon(index, height, radius=RADIUS).dip)
        cases.append(
            Case(
                f"dip of the sea's horizon from {height:g} m",
                "invariant of Bouguer, and DOP853",
                dip * ARCMIN,
                found,
                2e-6 * ARCMIN,
                ARCMIN,
                "′",
            )
        )
    k = float(refraction_coefficient(index, 0.0, radius=RADIUS))
    cases.append(
        Case(
            "coefficient of terrestrial refraction k at the ground",
            "−(R/n) dn/dh, closed form",
            0.16988762,
            k,
            1e-6,
        )
    )
    return cases


def _sunset() -> list[Case]:
    """Young's profile with his constants; only g/R matters, so that his gas goes into the gravity."""
    heights = (0.0, 0.8, 1.8, 2.7, 4.0, 5.9, 8.9, 18.1, 32.5, 50.0, 11000.0)
    temperatures = (288.0, 287.5, 287.3, 287.2, 287.1, 287.0, 286.9, 286.7, 286.5, 286.3, 216.0)
    spec = ProfileSpec(
        kind="table", heights=heights, temperatures=temperatures, smoothing=0.0, beyond="isothermal"
    )
    built = spec.build(Earth())
    gas = 8.314462618 / 0.028964 / 287.053
    profile = Profile(
        built.course,
        built.vapour,
        built.vapour_is,
        built.base,
        built.top,
        101_325.0,
        lambda height: np.full_like(height, 9.80665 / gas),
    )
    constant = 2.871e-4 * (1 + 5.67e-3 / 0.7**2) / 1.29223 / gas
    law = Atmosphere(model="gladstone-dale", gladstone_dale_constant=constant, wavelength=700e-9)
    index = profile.index(law)
    apparent, expected = np.array(list(YOUNG)), np.array(list(YOUNG.values()))
    found = astronomical_refraction(
        index, apparent * ARCMIN, radius=6_378_140.0, observer_height=9.28, into_vacuum=True
    ).ravel()
    source = "A. T. Young's profile, two programs"
    cases = [
        Case(
            f"inferior-mirage sunset, {YOUNG_NAMES[part]} high", source, expected[at] * ARCMIN,
            float(found[at]), 1e-3 * ARCMIN, ARCMIN, "′",
        )
        for at, part in enumerate(apparent)
        if part in YOUNG_NAMES
    ]  # fmt: skip
    off = found / ARCMIN - expected
    worst = float(off[np.argmax(np.abs(off))])
    return [*cases, Case("the same, worst of 12 between −5.4′ and 30′", source, 0.0, worst, 1e-3, unit="′")]


def _light() -> list[Case]:
    cases = [
        Case(
            f"optical depth of molecules, {length} nm",
            "Bodhaine et al. 1999, table 3",
            depth,
            float(rayleigh_optical_depth(length * 1e-9, pressure=101_325.0)),
            1e-5,
        )
        for length, depth in ((400, 0.36022), (550, 0.09707), (700, 0.03642))
    ]
    peak = float(ozone_cross_section(np.arange(560, 640) * 1e-9).max())
    source = "Serdyuchenko et al. 2014"
    cases.append(
        Case("ozone at the peak of Chappuis's bands", source, 5.1e-25, peak, 1.5e-26, 1e-25, "10⁻²⁵ m²")
    )
    return cases


def _marched() -> tuple[list[Case], np.ndarray]:
    """Rays of a scene, to the top of its air and on into the vacuum, against the published refraction."""
    profile, law = _in_proportion(590e-9)
    apparent = np.array(list(US1976))
    refraction = refraction_rays.marched(apparent, law, float(profile.refractivity(86e3, law)))
    off = refraction / ARCSEC - np.array(list(US1976.values()))
    worst = float(off[np.argmax(np.abs(off))])
    what = "marched rays through the same standard air, worst of 7 elevations"
    return [Case(what, "as above, 0° to 60°", 0.0, worst, 0.01, unit="″")], off


def _draw(path: Path, marched: np.ndarray) -> None:
    """Deviation of both integrators from the published refraction of the standard atmosphere."""
    apparent = np.array(list(US1976))
    integral = np.array([_refraction(590e-9, math.radians(part)) for part in apparent]) / ARCSEC
    both = (integral - np.array(list(US1976.values())), "integral", BLUE), (marched, "marched rays", RED)
    with panels(path, 1) as (axes,):
        for values, name, colour in both:
            axes.loglog(np.maximum(apparent, 0.1), np.abs(values), "o-", color=colour, label=name)
        axes.axhline(0.01, color="0.5", linestyle="--", label="allowed")
        axes.set_xlabel("apparent elevation, degrees (0 stands at 0.1)")
        axes.set_ylabel("deviation, ″")
        axes.legend()
