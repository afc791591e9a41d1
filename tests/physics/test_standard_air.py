"""Standard atmospheres and profiles against published tables and closed forms."""

from __future__ import annotations

import itertools
from typing import Any, Literal

import numpy as np
import pytest
from scipy.integrate import quad

from nigemizu import InputError
from nigemizu.air import Atmosphere, Earth, Inversion, ProfileSpec, standard_atmosphere
from nigemizu.air.standards import standard_breaks, standard_gravity, standard_temperature
from nigemizu.trace import refraction_coefficient

R = 6_371_000.0

# U.S. Standard Atmosphere 1976, table I: geometric height [m], kelvins, pascals.
TABLE = (
    (0, 288.150, 101325.0),
    (1000, 281.651, 89876.0),
    (5000, 255.676, 54048.0),
    (10000, 223.252, 26500.0),
    (15000, 216.650, 12111.0),
    (20000, 216.650, 5529.3),
    (30000, 226.509, 1197.0),
    (40000, 250.350, 287.14),
    (50000, 270.650, 79.779),
    (60000, 247.021, 21.958),
    (70000, 219.585, 5.2209),
    (80000, 198.639, 1.0524),
)


@pytest.mark.parametrize(("height", "temperature", "pressure"), TABLE)
def test_standard_of_1976(height: float, temperature: float, pressure: float) -> None:
    found = standard_atmosphere(height)
    assert found[0] == pytest.approx(temperature, abs=6e-4)
    # Five digits are printed, the last of them cut off.
    assert found[1] == pytest.approx(pressure, rel=1e-4)
    assert found[2] == pytest.approx(pressure / (287.0529 * temperature), rel=1.1e-4)


# The same, table of base levels: geopotential height [m], molecular-scale kelvins, pascals.
BASES = (
    (11_000, 216.65, 22632.06),
    (20_000, 216.65, 5474.889),
    (32_000, 228.65, 868.0187),
    (47_000, 270.65, 110.9063),
    (51_000, 270.65, 66.93887),
    (71_000, 214.65, 3.956420),
)


@pytest.mark.parametrize("kind", ["us1976", "isa"])
@pytest.mark.parametrize(("geopotential", "temperature", "pressure"), BASES)
def test_base_levels(
    geopotential: int, temperature: float, pressure: float, kind: Literal["us1976", "isa"]
) -> None:
    found = standard_atmosphere(6_356_766.0 * geopotential / (6_356_766.0 - geopotential), kind)
    assert found[0] == pytest.approx(temperature, rel=1e-10)
    assert found[1] == pytest.approx(pressure, rel=1e-6)


def test_a_break_belongs_to_the_layer_above_it() -> None:
    """Layers of 0, 1, 2.8, 0, −2.8 and −2 K per geopotential kilometre begin there."""
    breaks = standard_breaks()
    metres = (1 + breaks / 6_356_766.0) ** 2 * 1e3  # per geopotential kilometre, in units of K/m
    for heights, lapses in ((breaks, [0, 1, 2.8, 0, -2.8, -2]), (breaks - 1e-6, [-6.5, 0, 1, 2.8, 0, -2.8])):
        np.testing.assert_allclose(standard_temperature(heights)[1] * metres, lapses, rtol=1e-9, atol=1e-12)


def test_heights_without_a_standard() -> None:
    for height, kind in ((86_001.0, "us1976"), (80_001.0, "isa"), (-5001.0, "isa"), (np.nan, "us1976")):
        with pytest.raises(InputError, match="height"):
            standard_atmosphere(height, kind)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="us1976 or isa"):
        standard_atmosphere(0.0, "icao")  # type: ignore[arg-type]


def test_the_top_of_the_standard() -> None:
    """86 km, 84.852 km of geopotential height: 186.946 K molecular-scale, 0.37338 Pa (base values)."""
    temperature, pressure, _ = standard_atmosphere(86_000.0)
    assert temperature == pytest.approx(186.946, abs=1e-3)
    assert pressure == pytest.approx(0.37338, rel=1e-5)


def test_a_profile_integrates_to_the_standard() -> None:
    """Quadrature of the temperatures against the closed form of the pressures; R differs by 3e-7."""
    profile = ProfileSpec(kind="us1976").build(Earth())
    heights = np.array([0.0, 13.0, 5000.0, 11_019.0, 32_500.0, 60_000.0, 86_000.0])
    temperature, pressure, vapour = profile.at(heights)
    exact = standard_atmosphere(heights)
    np.testing.assert_allclose(temperature, exact[0], rtol=1e-12)
    np.testing.assert_allclose(pressure, exact[1], rtol=5e-6)
    assert not vapour.any()
    # Another constant of the gas gives another pressure: the agreement is no accident.
    assert abs(exact[1][3] * 287.053 / 287.0 / pressure[3] - 1) > 1e-4


def test_isothermal_air_is_exponential() -> None:
    """p = p₀ exp(−g₀ H/(R T)), H the geopotential height for gravity that falls as 1/r²."""
    earth = Earth()
    spec = ProfileSpec(
        kind="table", heights=(0.0, 1000.0), temperatures=(250.0, 250.0), smoothing=0.0, beyond="isothermal"
    )
    heights = np.array([10.0, 1000.0, 20_000.0, 80_000.0])
    geopotential = earth.radius * heights / (earth.radius + heights)
    exact = 101_325.0 * np.exp(-earth.gravity(0.0) * geopotential / (287.053 * 250.0))
    np.testing.assert_allclose(spec.build(earth).at(heights)[1], exact, rtol=1e-9)


def test_moist_air_weighs_less() -> None:
    """Over the first metre with the scale height R_d T_v/g, T_v = T (1 + 0.61 q) (Wallace & Hobbs, 3.16)."""
    moist = ProfileSpec(kind="us1976", relative_humidity=0.8).build(Earth())
    temperature, pressure, fraction = moist.at(np.array([0.0, 1.0]))
    q = fraction[0] * 0.622 / (1 - fraction[0] * 0.378)
    virtual = temperature[0] * (1 + 0.608 * q)
    assert -np.log(pressure[1] / pressure[0]) == pytest.approx(
        float(standard_gravity(0.0)) / (287.053 * virtual), rel=2e-4
    )
    assert 0.012 < fraction[0] < 0.015  # 80 % at 15 °C: e_s = 17.05 hPa


PROFILES: dict[str, dict[str, Any]] = {
    "moist": {"kind": "us1976", "surface_temperature": 300.0, "relative_humidity": 0.7},
    "table": {
        "kind": "table",
        "heights": (0.0, 30.0, 50.0, 2000.0, 11000.0),
        "temperatures": (288.0, 287.8, 288.6, 279.0, 217.4),
        "relative_humidities": (0.9, 0.8, 0.7, 0.5, 0.1),
    },
    "inversion": {"kind": "isa", "layers": (Inversion(jump=5.0, height=30.0, thickness=4.0, decay=300.0),)},
    "road": {
        "kind": "isa",
        "surface_layer": {
            "ground_temperature": 330.0,
            "air_temperature": 305.0,
            "wind": 3.0,
            "roughness": 2e-3,
        },
    },
}


@pytest.mark.parametrize("name", PROFILES)
def test_air_stands_under_its_own_weight(name: str) -> None:
    """ln p against ∫ −g/(R_d T_v) dh by adaptive quadrature, T_v = T/(1 − (1 − M_w/M_d) x).

    J. M. Wallace, P. V. Hobbs, Atmospheric Science, 2nd ed. (2006), eqs. 3.16 and 3.23.
    """
    profile = ProfileSpec(**PROFILES[name]).build(Earth())

    def weight(height: float, heavier: float = 0.0) -> float:
        temperature, _, fraction = profile.at(height)
        virtual = temperature / (1 - (1 - 0.018015 / 0.0289635) * fraction) + heavier
        return float(profile.gravity(np.asarray(height)) / (287.053 * virtual))

    stops = np.concatenate([[0.0], np.geomspace(1e-3, 79e3, 30), profile.breaks[profile.breaks < 79e3]])
    stops = np.unique(stops)
    drops = [quad(weight, a, b, epsabs=0.0, epsrel=1e-11)[0] for a, b in itertools.pairwise(stops)]
    expected = 101_325.0 * np.exp(-np.concatenate([[0.0], np.cumsum(drops)]))
    np.testing.assert_allclose(profile.at(stops)[1], expected, rtol=1e-7)
    colder = quad(lambda height: weight(height, -0.01), 0.0, 1000.0, epsabs=1e-12, limit=200)[0]
    assert abs(101_325.0 * np.exp(-colder) / profile.at(1000.0)[1] - 1) > 1e-6


def test_index_at_the_surface() -> None:
    """n − 1 = 2.7713629991e-4 at 15 °C, 1013.25 hPa, 590 nm, 450 ppm of CO₂ (Ciddor 1996, computed apart).

    Ciddor's eq. 1, 5792105/(238.0185 − σ²) + 167917/(57.362 − σ²), is 0.2531 % larger at 550 nm.
    """
    profile = ProfileSpec().build(Earth())
    found = profile.refractivity(0.0, Atmosphere(), [590e-9, 550e-9])
    assert found.shape == (2,)
    assert found[0] == pytest.approx(2.7713629991e-4, rel=1e-10, abs=0)
    assert found[1] / found[0] - 1 == pytest.approx(2.531e-3, rel=1e-3, abs=0)
    assert profile.refractivity(0.0, Atmosphere()) == pytest.approx(found[1], rel=1e-14, abs=0)


def test_refraction_coefficient_at_the_surface() -> None:
    """k = −R dn/dh = 0.16988762 for 288.15 K, 1013.25 hPa, −6.5 K/km, 550 nm: derivative of Ciddor's n in the
    standard atmosphere; the geodesists' 503 P/T² (0.0343 + dT/dh) gives 0.17064."""
    index = ProfileSpec(kind="isa").build(Earth()).index(Atmosphere())
    assert float(refraction_coefficient(index, 0.0, radius=R)) == pytest.approx(0.16988762, abs=2e-4)
    warm = ProfileSpec(kind="isa", surface_temperature=298.15).build(Earth()).index(Atmosphere())
    assert abs(float(refraction_coefficient(warm, 0.0, radius=R)) - 0.16988762) > 5e-3


@pytest.mark.parametrize(
    ("temperature", "gradient"),
    [(273.15, 0.11209106493589768), (288.15, 0.1286238896001938), (300.0, 0.1423085306218616)],
)
def test_gradient_at_which_light_follows_the_earth(temperature: float, gradient: float) -> None:
    """dT/dz = T/(R (n − 1)) − g M/R*, g M/R* = 0.0341631947 K/m, for n − 1 proportional to p/T (dry air of
    101 325 Pa, 550 nm). In Ciddor's air n − 1 falls a little faster, as its compressibility nears 1: the same
    gradient bends light by 1 to 3 parts in 1000 more."""
    bare = float(Atmosphere().refractivity(temperature, 101_325.0))
    assert temperature / (R * bare) - 0.0341631947 == pytest.approx(gradient, rel=1e-6)
    spec = ProfileSpec(
        kind="table",
        heights=(0.0, 10.0),
        temperatures=(temperature, temperature + 10 * gradient),
        smoothing=0.0,
    )
    index = spec.build(Earth()).index(Atmosphere())
    assert 1.001 < float(refraction_coefficient(index, 0.0, radius=R)) < 1.003
