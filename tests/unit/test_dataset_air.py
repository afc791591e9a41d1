"""Air as a dataset: attributes, pressure, refractivity, interpolation in time."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from nigemizu.air import Atmosphere, refractivity
from nigemizu.errors import InputError
from nigemizu.heat import Grid, complete, mean_temperature_at, refractivity_at, to_dataset

GRID = Grid(np.linspace(0, 8, 9), np.linspace(-2, 2, 5), np.linspace(0, 1, 6) ** 2)
AIR = Atmosphere()
AXES = {"time": "T", "z": "Z", "y": "Y", "x": "X"}


def states(times=(0.0, 10.0, 30.0), surface=True):
    generator = np.random.default_rng(1)
    for time in times:
        yield SimpleNamespace(
            time=time,
            temperature=300.0 + generator.normal(size=GRID.shape),
            surface_temperature=np.full(GRID.shape[1:], 330.0) if surface else None,
        )


def test_attributes_follow_cf():
    data = to_dataset(GRID, states(), title="sand", scene="a = 1", history="nigemizu simulate")
    assert data["air_temperature"].dims == ("time", "z", "y", "x")
    assert data["air_temperature"].attrs["standard_name"] == "air_temperature"
    assert data["surface_temperature"].attrs["standard_name"] == "surface_temperature"
    assert {name: data[name].attrs["axis"] for name in data.coords} == AXES
    assert data["z"].attrs["positive"] == "up"
    assert all(data[name].attrs["units"] == "m" for name in "xyz")
    assert np.array_equal(data["z_bounds"].values[:, 0], GRID.z_edges[:-1])
    assert data.attrs["Conventions"] == "CF-1.11"
    assert data.attrs["nigemizu_scene"] == "a = 1"
    assert data.attrs["source"].startswith("nigemizu ")


def test_states_must_fit():
    with pytest.raises(InputError, match="no instant"):
        to_dataset(GRID, [])
    bad = SimpleNamespace(time=0.0, temperature=np.zeros((2, 2, 2)), surface_temperature=None)
    with pytest.raises(InputError, match="does not fit the grid"):
        to_dataset(GRID, [bad])


def test_completed_with_pressure_and_refractivity():
    """Each cell is the law of its own temperature at the hydrostatic pressure of its level."""
    data = to_dataset(GRID, states())
    done = complete(data, AIR)
    assert "air_refractivity" not in data
    assert done["air_pressure"].dims == ("time", "z")
    pressure = float(done["air_pressure"][1, 4])
    # isothermal closed form at the mean 300 K, 0.82 m up: the mean differs by less than 1 K
    assert pressure == pytest.approx(101325.0 * np.exp(-9.80665 * 0.82 / (287.053 * 300.0)), abs=0.04)
    direct = refractivity(data["air_temperature"].values[1, 4], pressure)
    assert done["air_refractivity"].values[1, 4] == pytest.approx(direct, rel=1e-14)
    with pytest.raises(InputError, match="no temperature"):
        complete(done.drop_vars("air_temperature"), AIR)


def test_linear_between_instants():
    data = to_dataset(GRID, states())
    early, late = (refractivity_at(data, time, AIR)[3] for time in (10.0, 30.0))
    between = refractivity_at(data, 15.0, AIR)[3]
    assert between == pytest.approx(0.75 * early + 0.25 * late, rel=1e-14)
    assert not np.allclose(between, early, rtol=1e-6)


@pytest.mark.parametrize("time", [-1e-9, 30.1, np.nan])
def test_time_outside(time):
    with pytest.raises(InputError, match="from 0 s to 30 s"):
        refractivity_at(to_dataset(GRID, states()), time, AIR)
    with pytest.raises(InputError, match="5 s, its only instant"):
        refractivity_at(to_dataset(GRID, states((5.0,))), time, AIR)


def test_the_ground_is_the_lowest_node():
    """Its refractivity is that of the skin at the surface pressure; without a skin there is no such node."""
    x, y, z, values = refractivity_at(to_dataset(GRID, states()), 0.0, AIR)
    assert z[0] == 0.0
    assert np.array_equal(z[1:], GRID.z)
    assert values.shape == (z.size, y.size, x.size)
    assert values[0] == pytest.approx(float(refractivity(330.0, 101325.0)), rel=1e-12)
    _, _, z, values = refractivity_at(to_dataset(GRID, states(surface=False)), 0.0, AIR)
    assert np.array_equal(z, GRID.z)
    assert values.shape == GRID.shape


def test_mean_temperature_goes_with_the_nodes():
    """The skin first where it is known, linear in time, nothing where only the refractivity is stored."""
    data = to_dataset(GRID, states())
    air = data["air_temperature"].values.mean(axis=(2, 3))
    found = mean_temperature_at(data, 15.0)
    assert found.size == refractivity_at(data, 15.0, AIR)[2].size
    assert found[0] == 330.0
    assert found[1:] == pytest.approx(0.75 * air[1] + 0.25 * air[2], rel=1e-14)
    assert mean_temperature_at(to_dataset(GRID, states(surface=False)), 0.0) == pytest.approx(air[0])
    assert mean_temperature_at(complete(data, AIR)[["air_refractivity"]], 0.0) is None
    with pytest.raises(InputError, match="from 0 s to 30 s"):
        mean_temperature_at(data, 31.0)


def test_stored_pressure_and_humidity_win():
    data = to_dataset(GRID, states((0.0,), surface=False))
    data["air_pressure"] = ("z", np.full(5, 9e4))
    data["relative_humidity"] = data["air_temperature"] * 0.0 + 0.5
    values = refractivity_at(data, 0.0, AIR)[3]
    direct = refractivity(data["air_temperature"].values[0], 9e4, relative_humidity=0.5)
    assert values == pytest.approx(direct, rel=1e-14)


def test_refractivity_alone_is_enough():
    done = complete(to_dataset(GRID, states(surface=False)), AIR)
    bare = done[["air_refractivity"]]
    assert np.array_equal(refractivity_at(bare, 10.0, AIR)[3], done["air_refractivity"].values[1])


def test_a_profile_holds_everywhere():
    profile = xr.Dataset({"air_temperature": ("z", [320.0, 305.0, 300.0])}, {"z": [0.0, 0.1, 1.0]})
    x, y, z, values = refractivity_at(profile, 1234.5, AIR)
    assert x[1] - x[0] >= 1e5
    assert y[1] - y[0] >= 1e5
    assert values.shape == (3, 2, 2)
    assert np.all(values == values[:, :1, :1])
    assert values[0, 0, 0] == pytest.approx(float(refractivity(320.0, 101325.0)), rel=1e-14)
    done = complete(profile, AIR)
    assert done["air_refractivity"].dims == ("z",)
    assert z.tolist() == [0.0, 0.1, 1.0]


def test_order_of_the_axes_does_not_matter():
    data = to_dataset(GRID, states())
    turned = data.transpose("x", "time", "y", "z", "bounds")
    assert np.array_equal(refractivity_at(turned, 12.0, AIR)[3], refractivity_at(data, 12.0, AIR)[3])
