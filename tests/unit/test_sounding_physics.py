"""What makes a sounding of numbers: vapour over water, heights, gaps filled by the weight of the air."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nigemizu.air import hydrostatic_pressure, saturation_vapour_pressure, water_vapour_fraction
from nigemizu.heat import read_sounding
from nigemizu.heat.reading.soundings import heights, humidity

CELSIUS = 273.15


@pytest.mark.parametrize(
    ("kelvin", "pascal"),
    # Murphy and Koop 2005, table C1, liquid water.
    [(180.0, 0.011239), (210.0, 1.2335), (240.0, 37.667), (273.15, 611.213), (300.0, 3536.8)],
)
def test_saturation_over_supercooled_water(kelvin, pascal):
    # Above 0 °C another equation, of IAPWS-IF97, is meant to differ by less than 2e-4.
    assert float(humidity.saturation_over_water(kelvin)) == pytest.approx(pascal, rel=2e-4, abs=0)


def test_saturation_over_water_is_not_that_over_ice():
    assert float(humidity.saturation_over_water(240.0) / saturation_vapour_pressure(240.0)) == pytest.approx(
        37.667 / 27.272, rel=1e-3, abs=0
    )
    below, above = humidity.saturation_over_water(np.array([273.1599, 273.1601]))
    assert above / below == pytest.approx(math.exp(2e-4 * 19.8 / 273.16), abs=1e-5)  # Clausius and Clapeyron


def test_dew_point_and_relative_humidity_tell_the_same_vapour():
    # 20 °C and 50 %: dew point 9.27 °C (Lawrence 2005, doi:10.1175/BAMS-86-2-225, by its Magnus formula).
    pressure = np.array([101325.0])
    from_dew = humidity.from_dew_point(np.array([9.27 + CELSIUS]), pressure)
    assert from_dew == pytest.approx(water_vapour_fraction(293.15, pressure, 0.5), rel=2e-3, abs=0)


def test_measures_of_humidity_are_one_amount_of_water():
    # 10 g of vapour per kg of dry air, by the molar masses: 0.01/0.018015 against 1/0.0289635.
    fraction = (0.01 / 0.018015) / (0.01 / 0.018015 + 1.0 / 0.0289635)
    assert humidity.from_mixing_ratio(np.array([0.01])) == pytest.approx(fraction, rel=1e-12, abs=0)
    assert humidity.from_mass_fraction(np.array([0.01 / 1.01])) == pytest.approx(fraction, rel=1e-12, abs=0)


@pytest.mark.parametrize(
    ("latitude", "kilometre"),
    # Integral of the normal gravity of WGS 84, its series to second order (NIMA TR8350.2, eq. 4-3).
    [(0.0, 30.0), (45.0, 30.0), (90.0, 10.0), (-35.0, 5.0)],
)
def test_geometric_heights_by_the_gravity_of_the_ellipsoid(latitude, kilometre):
    a, f, m = 6378137.0, 1 / 298.257223563, 0.00344978650684
    sine = math.sin(math.radians(latitude)) ** 2
    gravity = 9.7803253359 * (1 + 0.00193185265241 * sine) / math.sqrt(1 - 0.00669437999013 * sine)
    z = np.linspace(0.0, 1e3 * kilometre, 10001)
    weight = gravity * (1 - 2 / a * (1 + f + m - 2 * f * sine) * z + 3 * z**2 / a**2)
    potential = float(np.sum(0.5 * (weight[1:] + weight[:-1]) * np.diff(z))) / 9.80665
    assert float(heights.geometric(np.array(potential), latitude)) == pytest.approx(z[-1], abs=0.1)
    assert abs(z[-1] - potential) > 3.0  # what would be wrong without


@given(st.floats(-400.0, 8e4), st.floats(-90.0, 90.0))
def test_geopotential_and_back(height, latitude):
    there = heights.geopotential(np.array(height), latitude)
    assert float(heights.geometric(there, latitude)) == pytest.approx(height, abs=1e-6)


def column(n=41):
    tall = np.linspace(0.0, 8000.0, n)
    temperature = 300.0 - 6.5e-3 * tall
    return tall, temperature, hydrostatic_pressure(tall, temperature, surface_pressure=1e5)


def test_heights_follow_from_pressures():
    tall, temperature, pressure = column()
    known = np.full(tall.size, np.nan)
    known[0] = 120.0
    filled = heights.fill_heights(known, pressure, temperature)
    assert filled == pytest.approx(tall + 120.0, abs=0.05)
    assert heights.fill_heights(np.full(tall.size, np.nan), pressure, temperature)[0] == 0.0


def test_filled_heights_meet_the_known_ones():
    tall, temperature, pressure = column()
    known = np.full(tall.size, np.nan)
    known[[3, 20]] = tall[[3, 20]] * 1.01
    filled = heights.fill_heights(known, pressure, temperature)
    assert filled[[3, 20]] == pytest.approx(known[[3, 20]], abs=0)
    assert filled[10] == pytest.approx(1.01 * tall[10], abs=0.05)
    assert filled[-1] - filled[20] == pytest.approx(tall[-1] - tall[20], abs=0.05)
    assert filled[3] - filled[0] == pytest.approx(tall[3] - tall[0], abs=0.05)


def test_pressures_follow_from_heights():
    tall, temperature, pressure = column()
    known = np.full(tall.size, np.nan)
    known[0] = pressure[0]
    assert heights.fill_pressures(known, tall, temperature) == pytest.approx(pressure, rel=1e-12, abs=0)


def write(tmp_path, text, name="air.csv"):
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    return file


def moist_table(humidities, temperatures=(20.0, 10.0, 0.0, -10.0, -5.0)):
    rows = [f"{1500 * i},{t},{h}" for i, (t, h) in enumerate(zip(temperatures, humidities, strict=True))]
    return "# surface_pressure = 1000 hPa\nheight [m],temperature [C],humidity [%]\n" + "\n".join(rows)


def test_missing_humidity_is_interpolated_and_above_never_rises(tmp_path):
    sounding = read_sounding(write(tmp_path, moist_table([80, "", 60, "", ""])))
    full = read_sounding(write(tmp_path, moist_table([80, 70, 60, 60, 60]), "full.csv"))
    got, whole = sounding.vapour_fraction, full.vapour_fraction
    assert got[[0, 2, 3]] == pytest.approx(whole[[0, 2, 3]], rel=1e-3, abs=0)
    assert got[1] == pytest.approx(whole[1], rel=0.01, abs=0)  # linear in ln p, 70 % within 0.6
    # The inversion at the top would hold more at the same relative humidity.
    assert got[4] == got[3] < 0.75 * whole[4]
    assert any("3 levels without any, 2 of them above" in note for note in sounding.notes)


def test_air_without_humidity_is_dry_and_says_so(tmp_path):
    sounding = read_sounding(write(tmp_path, moist_table([""] * 5)))
    assert not sounding.vapour_fraction.any()
    assert "no humidity anywhere: taken as dry" in sounding.notes


def test_pressures_of_a_table_bear_the_vapour(tmp_path):
    sounding = read_sounding(write(tmp_path, moist_table([100] * 5, (30.0, 20.0, 10.0, 5.0, 0.0))))
    humid = hydrostatic_pressure(
        sounding.height, sounding.temperature, surface_pressure=1e5, relative_humidity=1.0
    )
    dry = hydrostatic_pressure(sounding.height, sounding.temperature, surface_pressure=1e5)
    # The gravity of the ellipsoid at 45° and its fall with height: 6 km weigh 0.1 % less there.
    assert sounding.pressure[-1] == pytest.approx(humid[-1], rel=1e-3, abs=0)
    assert abs(sounding.pressure[-1] / dry[-1] - 1.0) > 3e-3
    assert sounding.pressure[0] == pytest.approx(1e5, rel=1e-12, abs=0)


@given(
    st.lists(st.floats(1.0, 400.0), min_size=4, max_size=12),
    st.lists(st.floats(-60.0, 40.0), min_size=12, max_size=12),
    st.lists(st.floats(0.0, 100.0), min_size=12, max_size=12),
)
def test_any_table_of_believable_air_comes_back(tmp_path_factory, steps, celsius, percent):
    height = np.concatenate([[0.0], np.cumsum(steps)]).round(3)
    celsius = np.resize(celsius, height.size).round(2)
    percent = np.resize(percent, height.size).round(1)
    pressure = hydrostatic_pressure(height, celsius + CELSIUS) / 100.0
    rows = zip(height, celsius, pressure, percent, strict=True)
    text = "height [m];temperature [°C];pressure [hPa];humidity [%]\n" + "\n".join(
        ";".join(f"{value:.6f}" for value in row) for row in rows
    )
    sounding = read_sounding(write(tmp_path_factory.mktemp("air"), text))
    assert sounding.height == pytest.approx(height, abs=1e-6)
    assert sounding.temperature == pytest.approx(celsius + CELSIUS, abs=1e-6)
    assert sounding.pressure == pytest.approx(pressure * 100.0, rel=1e-8, abs=0)
    full = humidity.saturated(sounding.temperature, sounding.pressure)
    assert sounding.vapour_fraction == pytest.approx(percent / 100.0 * full, rel=1e-9, abs=1e-15)
    assert (np.diff(sounding.height) > 0).all()
    assert (np.diff(sounding.pressure) < 0).all()


def test_a_sounding_is_frozen(tmp_path):
    sounding = read_sounding(write(tmp_path, moist_table([50] * 5)))
    with pytest.raises(ValueError, match="read-only"):
        sounding.temperature[0] = 0.0
    with pytest.raises(AttributeError):
        sounding.time = None
    assert "5 levels, 0 to 6000 m, 293.1 K" in repr(sounding)
