"""Refractivity of air against published numbers.

Rationale: the bending of every ray is a difference of refractivities of a few parts in a million.
Expected: the tables of the papers to their last printed digit, and derived quantities to theirs.
"""

import numpy as np
import pytest

from nigemizu.air import (
    compressibility,
    critical_angle,
    density,
    peck_reeder,
    refractivity,
    saturation_vapour_pressure,
)

# Ciddor 1996, Applied Optics 35, 1566, doi:10.1364/AO.35.001566; (n - 1) x 1e8 at 633 nm in vacuum.
# Table 1, dry air with 450 ppm CO2: °C, Pa, refractivity.
CIDDOR_TABLE_1 = [(20.0, 80e3, 21458.0), (20.0, 120e3, 32191.6), (10.0, 100e3, 27774.7)]
# Table 2, laboratory air: °C, Pa, vapour pressure in Pa (not enhanced), CO2 in ppm, refractivity, tolerance.
# Row 2 is misprinted by 0.33 against its own neighbours, hence its tolerance.
CIDDOR_TABLE_2 = [
    (19.526, 102094.8, 1065.0, 510.0, 27392.9, 0.1),
    (19.517, 102096.8, 1065.0, 510.0, 27394.0, 0.5),
    (19.173, 103006.0, 642.0, 440.0, 27685.8, 0.1),
    (19.188, 102918.8, 706.0, 450.0, 27658.7, 0.1),
    (19.189, 102927.8, 708.0, 440.0, 27660.8, 0.1),
    (19.534, 103596.2, 962.0, 600.0, 27800.8, 0.1),
    (19.534, 103599.2, 951.0, 610.0, 27802.2, 0.1),
]
# Table 3, extreme humidity, 450 ppm: °C, Pa, relative humidity, refractivity. The second of these is printed
# as 19996.5; the table's own column of differences says 19896.5.
CIDDOR_TABLE_3 = [
    (20.0, 80e3, 0.75, 21394.0),
    (40.0, 80e3, 0.75, 19896.5),
    (40.0, 120e3, 0.75, 29941.8),
    (50.0, 120e3, 1.0, 28792.4),
]
# NIST Engineering Metrology Toolbox (emtoolbox.nist.gov/Wavelength), Ciddor, 450 ppm: °C, kPa, %, nm, n.
NIST_CIDDOR = [
    (20, 101.325, 0, 633, 1.0002718),
    (20, 60, 0, 633, 1.000160924),
    (20, 120, 0, 633, 1.000321916),
    (50, 100, 0, 633, 1.000243285),
    (5, 100, 0, 633, 1.000282756),
    (-40, 100, 0, 633, 1.00033758),
    (50, 120, 100, 633, 1.000287924),
    (40, 120, 75, 633, 1.000299418),
    (20, 100, 100, 633, 1.000267394),
    (40, 110, 100, 1700, 1.000270247),
    (20, 101.325, 0, 1700, 1.000268479),
    (40, 110, 100, 300, 1.000289),
    (20, 101.325, 0, 300, 1.000286581),
    (-40, 120, 0, 300, 1.000427233),
]
# Package ref_index (its project page), which follows NIST's documentation: law, °C, %, n; 633 nm, 101 325 Pa.
REF_INDEX = [
    ("ciddor1996", 20.0, 20.0, 1.0002716285340578, 2e-10),
    ("edlen-nist", 20.0, 20.0, 1.000271629169165, 1e-13),
    ("edlen-nist", 20.0, 80.0, 1.0002711197635226, 1e-13),
    ("ciddor1996", 20.0, 80.0, 1.0002711183472626, 2e-10),
    ("edlen-nist", 60.0, 80.0, 1.0002339748542823, 1e-13),
    ("ciddor1996", 60.0, 80.0, 1.0002340241754055, 2e-10),
]
# Peck and Reeder 1972, J. Opt. Soc. Am. 62, 958, Table III: µm, (n - 1) x 1e8 at 15 °C and 101 325 Pa.
PECK_REEDER = [
    (1.6945208, 27314.19),
    (1.01425728, 27410.9),
    (0.64402492, 27638.092),
    (0.54622707, 27789.843),
    (0.3889751, 28336.843),
    (0.230289, 30787.68),
]
# Ciddor 1996, equation 1, worked out in double precision: nm, (n - 1) x 1e8 at 15 °C, 101 325 Pa, 450 ppm.
CIDDOR_EQUATION_1 = [
    (400.0, 28276.182348),
    (450.0, 28053.335551),
    (486.1, 27935.688311),
    (500.0, 27897.38106),
    (550.0, 27783.763543),
    (587.6, 27717.423919),
    (589.3, 27714.731598),
    (600.0, 27698.325629),
    (633.0, 27653.021044),
    (650.0, 27632.405835),
    (656.3, 27625.181285),
    (700.0, 27580.44985),
]
# Snell's law over an independent implementation of Ciddor's equation, air at 300 K and 101 325 Pa, 550 nm:
# excess of the road in K, drop of n, grazing angle in mrad.
ROAD = [
    (5.0, 4.385516411131718e-06, 2.9611989900372655),
    (10.0, 8.628741897886982e-06, 4.153661634514504),
    (15.0, 1.2736490903275666e-05, 5.046408688129695),
    (20.0, 1.6715149574464405e-05, 5.781130886365144),
    (25.0, 2.0570708892053702e-05, 6.413313014919802),
    (30.0, 2.4308794768668207e-05, 6.971715507670797),
    (40.0, 3.145338642274176e-05, 7.930341818512977),
    (50.0, 3.8187612524387404e-05, 8.738154092613014),
]


@pytest.mark.parametrize(("celsius", "pressure", "expected"), CIDDOR_TABLE_1)
def test_dry_air_of_ciddor(celsius, pressure, expected):
    value = 1e8 * refractivity(celsius + 273.15, pressure, wavelength=633e-9)
    assert value == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize(("celsius", "pressure", "vapour", "ppm", "expected", "tolerance"), CIDDOR_TABLE_2)
def test_laboratory_air_of_ciddor(celsius, pressure, vapour, ppm, expected, tolerance):
    kelvin = celsius + 273.15
    humidity = vapour / saturation_vapour_pressure(kelvin)
    value = 1e8 * refractivity(
        kelvin, pressure, relative_humidity=humidity, wavelength=633e-9, co2_fraction=1e-6 * ppm
    )
    assert value == pytest.approx(expected, abs=tolerance)


def test_laboratory_air_needs_the_enhancement_factor():
    """Negative control: the bare ratio of the pressures misses the table by more than its tolerance."""
    celsius, pressure, vapour, ppm, expected, tolerance = CIDDOR_TABLE_2[0]
    bare = 1e8 * refractivity(
        celsius + 273.15,
        pressure,
        vapour_fraction=vapour / pressure,
        wavelength=633e-9,
        co2_fraction=1e-6 * ppm,
    )
    assert bare - expected > tolerance


@pytest.mark.parametrize(("celsius", "pressure", "humidity", "expected"), CIDDOR_TABLE_3)
def test_extremely_humid_air_of_ciddor(celsius, pressure, humidity, expected):
    value = 1e8 * refractivity(celsius + 273.15, pressure, relative_humidity=humidity, wavelength=633e-9)
    assert value == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize(("celsius", "kilopascal", "percent", "nanometre", "expected"), NIST_CIDDOR)
def test_check_values_of_nist(celsius, kilopascal, percent, nanometre, expected):
    value = 1.0 + refractivity(
        celsius + 273.15,
        1e3 * kilopascal,
        relative_humidity=percent / 100,
        wavelength=1e-9 * nanometre,
    )
    assert value == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("model", "celsius", "percent", "expected", "tolerance"), REF_INDEX)
def test_independent_package(model, celsius, percent, expected, tolerance):
    value = 1.0 + refractivity(
        celsius + 273.15, 101325.0, relative_humidity=percent / 100, wavelength=633e-9, model=model
    )
    assert value == pytest.approx(expected, abs=tolerance)


@pytest.mark.parametrize(("micrometre", "expected"), PECK_REEDER)
def test_dispersion_measured_by_peck_and_reeder(micrometre, expected):
    assert 1e8 * peck_reeder(1e-6 * micrometre) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("micrometre", "expected"), PECK_REEDER[:-1])
def test_ciddor_took_over_the_shape_of_that_dispersion(micrometre, expected):
    """Between the measured lines the ratio is one constant to 1e-6, 3.05e-5 below one at 300 ppm of CO2."""
    value = 1e8 * refractivity(288.15, 101325.0, wavelength=1e-6 * micrometre, co2_fraction=300e-6)
    assert value / expected - 1.0 == pytest.approx(-3.06e-5, abs=2e-7)


@pytest.mark.parametrize(("nanometre", "expected"), CIDDOR_EQUATION_1)
def test_dispersion_of_standard_air(nanometre, expected):
    assert 1e8 * refractivity(288.15, 101325.0, wavelength=1e-9 * nanometre) == pytest.approx(
        expected, abs=1e-2
    )


def test_slope_with_temperature():
    """dn/dT = -8.918e-7 per K at 300 K, 101 325 Pa, 550 nm (Ciddor's equation differentiated numerically)."""
    hot, cold = refractivity([300.05, 299.95], 101325.0)
    assert (hot - cold) / 0.1 == pytest.approx(-8.918e-7, abs=5e-11)


def test_shop_floor_formula_of_nist():
    """n - 1 = 7.86e-4 p/T, p in kPa (NIST Engineering Metrology Toolbox, appendix B), 633 nm: to 0.05 %."""
    ratio = refractivity(300.0, 101325.0, wavelength=633e-9) / (7.86e-4 * 101.325 / 300.0)
    assert 1.0003 < ratio < 1.0005


def test_density_law_of_lehn_and_el_arini():
    """n - 1 = 2.26e-4 p/(287.053 T); 0.34 % below Ciddor at 300 K and 550 nm."""
    lehn = refractivity(300.0, 101325.0, model="lehn1978")
    assert lehn == pytest.approx(0.0002659143085074881, rel=1e-12)
    assert lehn == pytest.approx(2.26e-4 * density(300.0, 101325.0), rel=1e-14)
    assert lehn / refractivity(300.0, 101325.0) - 1.0 == pytest.approx(-3.4e-3, abs=1e-4)


def test_density_law_with_the_users_constant():
    value = refractivity(300.0, 101325.0, model="gladstone-dale", gladstone_dale_constant=2.27e-4)
    assert value == pytest.approx(2.27e-4 * 101325.0 / (287.053 * 300.0), rel=1e-12)


@pytest.mark.parametrize(("excess", "drop", "milliradian"), ROAD)
def test_critical_angle_over_a_hot_road(excess, drop, milliradian):
    cold, hot = 1.0 + refractivity([300.0, 300.0 + excess], 101325.0)
    assert cold - hot == pytest.approx(drop, rel=1e-9)
    assert 1e3 * critical_angle(hot, cold) == pytest.approx(milliradian, rel=1e-9)


def test_twenty_kelvin_turn_back_rays_flatter_than_twenty_minutes_of_arc():
    cold, hot = 1.0 + refractivity([300.0, 320.0], 101325.0)
    assert 60 * np.degrees(critical_angle(hot, cold)) == pytest.approx(19.87, abs=0.01)


def test_density_of_standard_air():
    """US Standard Atmosphere 1976, table 1: 1.2250 kg/m3 at 15 °C and 101 325 Pa, an ideal gas."""
    assert density(288.15, 101325.0) == pytest.approx(1.2250, abs=5e-5)


def test_density_of_real_air():
    """The second virial coefficient of air near 20 °C, B = -9e-6 m3/mol to 10 %, gives Z - 1 = B p/(R T).

    The gas constants, 8.31451/0.0289635 and 287.053 J/(kg K), differ by another 5e-5.
    """
    ideal = density(293.15, 101325.0, co2_fraction=400e-6)
    real = density(293.15, 101325.0, co2_fraction=400e-6, equation_of_state="bipm1991")
    compression = 9e-6 * 101325.0 / (8.31451 * 293.15)
    gas_constants = 287.053 / (8.31451 / 0.0289635) - 1.0
    assert real / ideal - 1.0 == pytest.approx(compression + gas_constants, abs=0.1 * compression)
    assert 1.0 - compressibility(293.15, 101325.0) == pytest.approx(compression, rel=0.1)


def test_moist_air_is_lighter_by_the_missing_mass_of_its_vapour():
    """rho/rho_dry = 1 - x (1 - 18.015/28.9635): two fifths of the vapour's share."""
    share = 0.0116  # about 50 % at 20 °C
    dry, moist = density(293.15, 101325.0), density(293.15, 101325.0, relative_humidity=0.5)
    assert 1.0 - moist / dry == pytest.approx(share * (1 - 18.015 / 28.9635), rel=3e-3)
