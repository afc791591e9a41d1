"""What the air refuses, and how it broadcasts."""

import numpy as np
import pytest
from pydantic import ValidationError

from nigemizu.air import (
    Atmosphere,
    critical_angle,
    density,
    hydrostatic_pressure,
    peck_reeder,
    refractivity,
    saturation_vapour_pressure,
    water_vapour_fraction,
)
from nigemizu.errors import InputError


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"temperature": -3.0}, ["temperature", "-3.0", "kelvin above 0"]),
        ({"temperature": 0.0}, ["temperature", "kelvin above 0"]),
        ({"temperature": [300.0, np.nan]}, ["temperature", "not a finite number", "index (1,)"]),
        ({"temperature": np.inf}, ["temperature", "not a finite number"]),
        ({"temperature": "warm"}, ["temperature", "not a number", "'warm'"]),
        ({"pressure": -1.0}, ["pressure", "pascal above 0"]),
        ({"relative_humidity": 50.0}, ["relative_humidity", "50.0", "0 to 1"]),
        ({"relative_humidity": -0.1}, ["relative_humidity", "0 to 1"]),
        ({"vapour_fraction": 1.1}, ["vapour_fraction", "0 to 1"]),
        ({"vapour_fraction": 0.1, "relative_humidity": 0.1}, ["vapour_fraction", "twice"]),
        ({"wavelength": 550.0}, ["wavelength", "550.0", "300e-9 to 1700e-9"]),
        ({"wavelength": 299e-9}, ["wavelength", "300e-9"]),
        ({"wavelength": 1701e-9}, ["wavelength", "1700e-9"]),
        ({"co2_fraction": 450.0}, ["co2_fraction", "450e-6"]),
        ({"model": "cidor"}, ["cidor", "did you mean 'ciddor1996'?", "lehn1978", "gladstone-dale"]),
        ({"model": "gladstone-dale"}, ["gladstone_dale_constant", "needs"]),
        ({"gladstone_dale_constant": 2e-4}, ["gladstone_dale_constant", "takes no"]),
        (
            {"model": "gladstone-dale", "gladstone_dale_constant": -1.0},
            ["gladstone_dale_constant", "above 0"],
        ),
        ({"temperature": 400.0, "relative_humidity": 0.9}, ["relative_humidity", "boils"]),
        ({"temperature": 700.0, "relative_humidity": 0.1}, ["relative_humidity", "boils"]),
        ({"temperature": [300.0, 310.0], "pressure": [1e5, 1e5, 1e5]}, ["shapes", "(2,)", "(3,)"]),
    ],
)
def test_refractivity_refuses(arguments, words):
    with pytest.raises(InputError) as raised:
        refractivity(**{"temperature": 300.0, "pressure": 101325.0, **arguments})
    message = str(raised.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: saturation_vapour_pressure(650.0), "647.096"),
        (lambda: water_vapour_fraction(400.0, 101325.0, 1.0), "boils"),
        (lambda: density(300.0, 101325.0, equation_of_state="real"), "bipm1991"),
        (lambda: peck_reeder(2e-6), "1700e-9"),
        (lambda: critical_angle(1.0003, 1.0002), "denser"),
        (lambda: critical_angle(0.5, 1.0002), "at least 1"),
        (lambda: hydrostatic_pressure([0.0, 2.0, 1.0], [300.0] * 3), "do not increase at index 2"),
        (lambda: hydrostatic_pressure([-1.0, 2.0], [300.0] * 2), "from 0 up"),
        (lambda: hydrostatic_pressure([0.0, 2.0], [300.0] * 3), "do not match"),
        (lambda: hydrostatic_pressure([0.0], [300.0], gravity=0.0), "gravity"),
    ],
)
def test_the_others_refuse(call, word):
    with pytest.raises(InputError, match=word):
        call()


@pytest.mark.parametrize("model", ["ciddor1996", "lehn1978", "edlen-nist"])
def test_arrays_broadcast_and_agree_with_scalars(model):
    """More cells than one block, mixed shapes and types: each value is that of its own scalar call."""
    temperature = np.linspace(280, 330, 12000).reshape(5, 40, 60).astype(np.float32)
    pressure = np.linspace(1.0e5, 1.01e5, 5)[:, None, None]
    humidity = np.linspace(0.0, 0.6, 60)
    values = refractivity(temperature, pressure, relative_humidity=humidity, model=model)
    assert values.shape == (5, 40, 60)
    assert values.dtype == np.float64
    for z, y, x in [(0, 0, 0), (4, 39, 59), (2, 20, 30)]:
        alone = refractivity(
            float(temperature[z, y, x]),
            float(pressure[z, 0, 0]),
            relative_humidity=float(humidity[x]),
            model=model,
        )
        assert values[z, y, x] == pytest.approx(float(alone), rel=1e-15)


def test_no_values_give_no_values():
    assert refractivity([], 101325.0).shape == (0,)


def test_order_of_memory_does_not_matter():
    temperature = np.linspace(280, 330, 24).reshape(2, 3, 4)
    plain = refractivity(temperature, 101325.0)
    turned = refractivity(np.asfortranarray(temperature), 101325.0)
    assert np.array_equal(plain, turned)
    assert np.array_equal(refractivity(temperature[::-1, :, ::2], 101325.0), plain[::-1, :, ::2])


def test_saturation_is_continuous_at_the_triple_point():
    """Ice and water meet at 611.657 Pa (Wagner, Saul, Pruss 1994, doi:10.1063/1.555947)."""
    below, above = saturation_vapour_pressure([273.16 - 1e-9, 273.16 + 1e-9])
    assert below == pytest.approx(611.657, abs=1e-4)
    assert above == pytest.approx(611.657, abs=1e-4)
    # IAPWS-IF97, table 35: 3536.58941 Pa at 300 K, 2.63889776 MPa at 500 K, 12.3443146 MPa at 600 K
    assert saturation_vapour_pressure([300.0, 500.0, 600.0]) == pytest.approx(
        [3536.58941, 2.63889776e6, 12.3443146e6], rel=1e-8
    )


def test_atmosphere_passes_everything_on():
    air = Atmosphere(
        relative_humidity=0.4,
        wavelength=633e-9,
        co2_fraction=600e-6,
        surface_pressure=9e4,
        model="edlen-nist",
    )
    direct = refractivity(
        310.0, 9e4, relative_humidity=0.4, wavelength=633e-9, co2_fraction=600e-6, model="edlen-nist"
    )
    assert air.refractivity(310.0, 9e4) == direct
    assert air.refractivity(310.0, 9e4, relative_humidity=0.0) > direct
    assert air.hydrostatic_pressure([0.0], [310.0])[0] == pytest.approx(9e4)


def test_mixed_vapour_is_the_same_everywhere():
    """At the temperature of its measurement both readings of the humidity agree; above it they part."""
    local = Atmosphere(relative_humidity=0.5)
    mixed = Atmosphere(relative_humidity=0.5, humidity_temperature=300.0)
    assert mixed.refractivity(300.0, 101325.0) == pytest.approx(
        float(local.refractivity(300.0, 101325.0)), rel=1e-14
    )
    assert mixed.refractivity(330.0, 101325.0) > local.refractivity(330.0, 101325.0)
    assert mixed.refractivity(320.0, 101325.0) == refractivity(
        320.0, 101325.0, vapour_fraction=mixed.vapour_fraction()
    )


@pytest.mark.parametrize(
    "fields",
    [
        {"relative_humidity": 50.0},
        {"surface_pressure": 0.0},
        {"wavelength": 550.0},
        {"model": "ciddor"},
        {"model": "gladstone-dale"},
        {"gladstone_dale_constant": 2.3e-4},
        {"humidity": 0.5},
        {"humidity_temperature": 20.0},
    ],
)
def test_atmosphere_refuses(fields):
    with pytest.raises(ValidationError):
        Atmosphere(**fields)


def test_atmosphere_is_frozen():
    with pytest.raises(ValidationError):
        Atmosphere().wavelength = 600e-9
