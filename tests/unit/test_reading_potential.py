"""From potential to absolute temperature, and from specific to relative humidity: closed forms."""

import numpy as np
import pytest
import xarray as xr

from nigemizu.air import Atmosphere, density, hydrostatic_pressure
from nigemizu.air.moist import DRY_AIR_GAS_CONSTANT, water_vapour_fraction
from nigemizu.errors import InputError
from nigemizu.heat import Initial, complete, mean_temperature_at, read_air, refractivity_at
from nigemizu.heat.reading import with_temperature

GRAVITY = 9.80665
HEAT_CAPACITY = 3.5 * DRY_AIR_GAS_CONSTANT  # of molecules of two atoms, J kg⁻¹ K⁻¹
Z = np.linspace(0.0, 1000.0, 201)


def adiabatic(theta=300.0, **attributes):
    return xr.Dataset(
        {"theta": (("z", "x"), np.full((Z.size, 3), theta), {"units": "K", **attributes})},
        {"z": Z, "x": [0.0, 1.0, 2.0]},
    )


@pytest.mark.parametrize("surface", [101325.0, 100000.0, 85000.0])
def test_air_of_one_potential_temperature_cools_dry_adiabatically(surface):
    atmosphere = Atmosphere(surface_pressure=surface)
    full = complete(read_air(adiabatic()), atmosphere)
    # Hydrostatics with T = θ (p/p₀)^κ: T falls by exactly g/c_p per metre (Wallace and Hobbs 2006, eq. 3.53).
    ground = 300.0 * (surface / 1e5) ** (2.0 / 7.0)
    expected = ground - GRAVITY / HEAT_CAPACITY * Z
    found = full["air_temperature"].values[:, 1]
    assert np.abs(found / expected - 1.0).max() < 1e-7
    pressure = surface * (expected / ground) ** 3.5
    assert np.abs(full["air_pressure"].values / pressure - 1.0).max() < 1e-6
    assert mean_temperature_at(full, 0.0) == pytest.approx(expected, rel=1e-7)
    assert mean_temperature_at(read_air(adiabatic()), 0.0, atmosphere) == pytest.approx(expected, rel=1e-7)
    # Negative control: forgetting the conversion misses by far more than the bound.
    assert np.abs(300.0 / expected - 1.0).max() > 1e-2


def test_index_of_converted_air_is_that_of_the_temperature_itself():
    expected = 300.0 * 1.01325 ** (2.0 / 7.0) - GRAVITY / HEAT_CAPACITY * Z
    absolute = xr.Dataset({"air_temperature": ("z", expected)}, {"z": Z})
    index = [refractivity_at(read_air(data), 0.0, Atmosphere())[3] for data in (adiabatic(), absolute)]
    assert np.abs(index[0][:, :1, :1] / index[1][:, :1, :1] - 1.0).max() < 1e-7
    forgotten = refractivity_at(
        xr.Dataset({"air_temperature": ("z", np.full(Z.size, 300.0))}, {"z": Z}), 0.0, Atmosphere()
    )
    assert np.abs(forgotten[3][:, 0, 0] / index[1][:, 0, 0] - 1.0).max() > 1e-3


def test_pressure_of_the_file_is_used():
    data = adiabatic().assign(phydro=("z", np.linspace(9.5e4, 8.5e4, Z.size), {"units": "Pa"}))
    found = read_air(data)["air_temperature"]
    assert found.values[:, 2] == pytest.approx(300.0 * (np.linspace(0.95, 0.85, Z.size)) ** (2.0 / 7.0))
    assert found.isel(z=7, x=0).item() == found.values[7, 0]


@pytest.mark.parametrize("given", [{"reference_pressure": 101325.0}, {"p0": "1013.25 hPa"}, {"p00": 1013.25}])
def test_reference_pressure_of_the_file(given):
    found = complete(read_air(adiabatic(**given)), Atmosphere())["air_temperature"]
    assert float(found[0, 0]) == pytest.approx(300.0, rel=1e-12)
    elsewhere = read_air(adiabatic().assign_attrs(given))["air_potential_temperature"]
    assert elsewhere.attrs["reference_pressure"] == pytest.approx(101325.0)


def test_reference_pressure_that_is_none():
    with pytest.raises(InputError, match=r"reference_pressure: no pressure .*'12 Pa'.*about 1000 hPa"):
        read_air(adiabatic(reference_pressure="12 Pa"))


def test_specific_humidity_is_the_same_vapour():
    height, kelvin = np.array([0.0, 50.0]), np.array([305.0, 303.0])
    pressure = hydrostatic_pressure(height, kelvin)
    fraction = water_vapour_fraction(kelvin, pressure, 0.4)
    mass = fraction * 0.018015 / (fraction * 0.018015 + (1.0 - fraction) * 0.0289635)
    data = xr.Dataset(
        {
            "ta": ("z", kelvin - 273.15, {"units": "degree_C"}),
            "air_pressure": ("z", pressure),
            "q": ("z", 1e3 * mass, {"units": "g/kg"}),
        },
        {"z": height},
    )
    air = with_temperature(read_air(data), Atmosphere())
    assert air["relative_humidity"].values == pytest.approx([0.4, 0.4], rel=1e-9)
    # Dalton: what the vapour takes from the density is 1 − ε of its mole fraction.
    dry, moist = density(kelvin, pressure), density(kelvin, pressure, relative_humidity=0.4)
    assert moist / dry == pytest.approx(1.0 - fraction * (1.0 - 0.018015 / 0.0289635), rel=1e-9)
    index = [
        refractivity_at(read_air(part), 0.0, Atmosphere())[3][0, 0, 0] for part in (data, data.drop_vars("q"))
    ]
    assert 0.99 < index[0] / index[1] < 0.9999  # humid air refracts less


def test_condensed_and_negative_water_is_no_vapour():
    data = xr.Dataset(
        {"ta": ("z", [300.0, 300.0], {"units": "K"}), "qt": ("z", [0.2, -1e-6], {"units": "kg/kg"})},
        {"z": [0.0, 1.0]},
    )
    assert with_temperature(read_air(data), Atmosphere())["relative_humidity"].values.tolist() == [1.0, 0.0]


def test_beginning_from_potential_temperature_needs_a_pressure(tmp_path):
    from nigemizu.heat import Grid

    grid = Grid(np.linspace(0, 2, 3), np.linspace(0, 2, 3), np.linspace(0, 1000, 5))
    adiabatic().to_netcdf(tmp_path / "theta.nc", engine="netcdf4")
    with pytest.raises(InputError, match=r"no temperature without a pressure; expected .*air_pressure"):
        Initial(dataset=tmp_path / "theta.nc").sample(grid)
    complete(read_air(tmp_path / "theta.nc"), Atmosphere()).load().to_netcdf(
        tmp_path / "whole.nc", engine="netcdf4"
    )
    volume = Initial(dataset=tmp_path / "whole.nc").sample(grid)
    ground = 300.0 * 1.01325 ** (2.0 / 7.0)
    assert volume[:, 0, 0] == pytest.approx(ground - GRAVITY / HEAT_CAPACITY * grid.z, rel=1e-6)
