"""Columns of models: ERA5 as its archive writes it, and other CF data."""

import numpy as np
import pytest
import xarray as xr

from nigemizu.errors import InputError
from nigemizu.heat import read_sounding
from nigemizu.heat.reading.soundings import humidity

LEVELS = np.array([200.0, 500.0, 700.0, 850.0, 925.0, 1000.0])  # hPa, falling heights as ERA5 has them
TEMPERATURE = np.array([218.0, 262.0, 278.0, 287.0, 291.5, 297.0])
HUMIDITY = np.array([1e-5, 1e-3, 4e-3, 8e-3, 1.1e-2, 1.5e-2])
LATITUDE = np.array([36.0, 35.75, 35.5])
LONGITUDE = np.array([139.0, 139.25, 139.5, 139.75])
TIME = np.array(["2026-07-01T00:00", "2026-07-01T12:00"], "M8[ns]")
AXES = ("valid_time", "pressure_level", "latitude", "longitude")


def geopotential():
    """Of air at rest under these temperatures, from 100 m at 1000 hPa [m² s⁻²]."""
    virtual = TEMPERATURE * (1.0 + 0.608 * HUMIDITY)
    steps = 287.053 * 0.5 * (virtual[1:] + virtual[:-1]) * np.diff(np.log(LEVELS))
    return 100.0 * 9.80665 + np.concatenate([np.cumsum(steps[::-1])[::-1], [0.0]])


def era5():
    shape = (TIME.size, LEVELS.size, LATITUDE.size, LONGITUDE.size)
    place = np.arange(12.0).reshape(1, 1, 3, 4) * 0.1 + np.array([0.0, 5.0]).reshape(2, 1, 1, 1)

    def everywhere(values):
        return np.broadcast_to(np.asarray(values).reshape(1, -1, 1, 1), shape).copy()

    return xr.Dataset(
        {
            "t": (AXES, everywhere(TEMPERATURE) + place, {"units": "K", "standard_name": "air_temperature"}),
            "q": (AXES, everywhere(HUMIDITY), {"units": "kg kg**-1", "standard_name": "specific_humidity"}),
            "z": (AXES, everywhere(geopotential()), {"units": "m**2 s**-2", "standard_name": "geopotential"}),
            "r": (AXES, everywhere(np.full(6, 55.0)), {"units": "%", "standard_name": "relative_humidity"}),
            "u": (AXES, everywhere(np.full(6, 3.0)), {"units": "m s**-1", "standard_name": "eastward_wind"}),
            "v": (
                AXES,
                everywhere(np.full(6, -4.0)),
                {"units": "m s**-1", "standard_name": "northward_wind"},
            ),
        },
        {
            "valid_time": ("valid_time", TIME, {"standard_name": "time"}),
            "pressure_level": ("pressure_level", LEVELS, {"units": "hPa", "positive": "down"}),
            "latitude": ("latitude", LATITUDE, {"units": "degrees_north"}),
            "longitude": ("longitude", LONGITUDE, {"units": "degrees_east"}),
            "number": 0,
            "expver": ("valid_time", ["0001", "0001"]),
        },
    )


def read(tmp_path, dataset, name="air.nc", **asked):
    file = tmp_path / name
    dataset.to_netcdf(file)
    return read_sounding(file, **asked)


HERE = {"place": (35.7, 139.7), "time": "2026-07-01 12:00"}


def test_era5(tmp_path):
    sounding = read(tmp_path, era5(), **HERE)
    assert sounding.pressure == pytest.approx(100.0 * LEVELS[::-1])
    # The node at 35.75° N, 139.75° E is row 1, column 3; the second time is 5 K warmer.
    assert sounding.temperature == pytest.approx(TEMPERATURE[::-1] + 0.7 + 5.0)
    assert sounding.place == (35.75, 139.75)
    assert f"{sounding.time:%Y-%m-%d %H}" == "2026-07-01 12"
    q = HUMIDITY[::-1]
    moles = q / 18.015 / (q / 18.015 + (1.0 - q) / 28.9635)
    assert sounding.vapour_fraction == pytest.approx(moles, rel=1e-9, abs=0)
    assert sounding.wind_speed == pytest.approx(np.full(6, 5.0))
    assert sounding.wind_direction == pytest.approx(np.full(6, 323.13), abs=0.01)  # it blows towards 143.13°
    thickness = np.diff(geopotential()[::-1]) / 9.7978  # gravity at 35.75° N
    assert np.diff(sounding.height)[:3] == pytest.approx(thickness[:3], rel=1e-3, abs=0)
    assert sounding.station_height == pytest.approx(100.09, abs=0.02)
    assert sounding.height[0] == 0.0


def test_longitudes_may_count_either_way(tmp_path):
    west = era5().assign_coords(longitude=("longitude", LONGITUDE + 150.0, {"units": "degrees_east"}))
    sounding = read(tmp_path, west, place=(35.5, -70.9), time="2026-07-01 00:00")
    assert sounding.place == (35.5, -71.0)
    assert sounding.temperature[0] == pytest.approx(297.0 + 0.8)


def test_levels_in_the_ground_are_left_out(tmp_path):
    ground = ((AXES[0], *AXES[2:]), np.full((2, 3, 4), 900.0), {"units": "hPa"})
    sounding = read(tmp_path, era5().assign(sp=ground), **HERE)
    assert sounding.pressure[0] == 85000.0
    assert "left out below the ground: 2 levels (level 1000 hPa, level 925 hPa)" in sounding.notes


def test_heights_without_geopotential_follow_from_the_pressures(tmp_path):
    with_z = read(tmp_path, era5(), place=(36.0, 139.0), time="2026-07-01 00:00")
    without = read(tmp_path, era5().drop_vars("z"), "bare.nc", place=(36.0, 139.0), time="2026-07-01 00:00")
    assert without.height == pytest.approx(with_z.height, rel=1e-3, abs=0.1)
    assert without.station_height is None
    assert "computed from the weight of the air: 6 heights" in without.notes


def test_relative_humidity_where_there_is_no_other(tmp_path):
    sounding = read(tmp_path, era5().drop_vars("q"), **HERE)
    full = humidity.saturated(sounding.temperature, sounding.pressure)
    assert sounding.vapour_fraction == pytest.approx(0.55 * full, rel=1e-9, abs=0)


def test_older_era5_and_gaps(tmp_path):
    older = era5().isel(valid_time=[0]).rename(valid_time="time", pressure_level="level")
    older = older.assign_coords(level=("level", LEVELS.astype(np.int32), {"units": "millibars"}))
    older["t"].attrs.clear()
    gaps = older.assign(t=older["t"].where(older["level"] != 500.0).assign_attrs(units="K"))
    sounding = read(tmp_path, gaps, place=(35.5, 139.0))
    assert sounding.pressure == pytest.approx([1e5, 92500.0, 85000.0, 70000.0, 20000.0])
    assert "left out for want of a temperature: 1 level (level 500 millibars)" in sounding.notes


def test_a_zarr_store_and_a_single_column(tmp_path):
    column = era5().sel(latitude=35.5, longitude=139.0).isel(valid_time=0)
    column.drop_vars(["number", "expver"]).to_zarr(tmp_path / "air.zarr", consolidated=False)
    sounding = read_sounding(tmp_path / "air.zarr")
    assert sounding.place == (35.5, 139.0)
    assert sounding.temperature[0] == pytest.approx(297.8)


def test_a_model_on_heights(tmp_path):
    height = np.array([10.0, 100.0, 400.0, 1000.0])
    temperature = np.array([300.0, 299.0, 296.0, 291.0])
    pressure = 1e5 * np.exp(-9.80665 * height / 287.053 / 298.0)
    dataset = xr.Dataset(
        {
            "ta": ("height", temperature, {"units": "K"}),
            "p": ("height", pressure, {"units": "Pa", "standard_name": "air_pressure"}),
        },
        {"height": ("height", height, {"units": "m", "positive": "up"})},
    )
    sounding = read(tmp_path, dataset)
    assert sounding.height == pytest.approx(height, abs=1e-6)
    assert sounding.station_height is None
    assert sounding.notes == ("no humidity anywhere: taken as dry",)
    over_sea = dataset.rename(height="altitude")
    sounding = read(tmp_path, over_sea, "sea.nc")
    assert sounding.height == pytest.approx(height - 10.0, abs=1e-6)
    assert sounding.station_height == pytest.approx(10.0, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "asked", "words"),
    [
        (
            lambda d: d,
            {"time": "2026-07-01 12:00"},
            "place: 3 places along the latitude; expected latitude 35.5 to 36",
        ),
        (
            lambda d: d,
            {"place": (35.7, 139.7)},
            "time: several times; expected one of 2 from 2026-07-01 00:00 to 2026-07-01 12",
        ),
        (
            lambda d: d,
            {**HERE, "time": "2026-07-01 06:00"},
            r"time: no such time \(got '2026-07-01 06:00'\); expected one of 2",
        ),
        (lambda d: d, {**HERE, "time": "2026-07-01"}, "time: 2 times on that day"),
        (
            lambda d: d,
            {**HERE, "place": (48.0, 139.5)},
            "place: the place lies 12 degrees of latitude outside",
        ),
        (
            lambda d: d,
            {**HERE, "place": (35.7, -139.5)},
            "place: the place lies 8.*longitude outside.*139 to 139.75",
        ),
        (lambda d: d.drop_vars("t"), HERE, "no temperature of the air; .* found q.*kg kg"),
        (
            lambda d: d.assign_coords(pressure_level=np.arange(6.0)).rename(pressure_level="hybrid"),
            HERE,
            "hybrid: no pressure of the levels",
        ),
        (lambda d: d.isel(pressure_level=[3, 4]), HERE, "only 2 levels can be used"),
        (
            lambda d: d.assign(t=d["t"] - 273.15),
            HERE,
            r"level 1000 hPa, temperature: a value that no air has \(got '29.55'\)",
        ),
        (
            lambda d: d.assign(z=d["z"] * 2.0),
            HERE,
            "level 925 hPa: height and pressure contradict each other",
        ),
        (
            lambda d: d.assign(q=d["q"] * 1000.0),
            HERE,
            r"level 1000 hPa, specific_humidity: a value that no air has \(got '15'\)",
        ),
        (lambda d: d.isel(pressure_level=2, drop=True), HERE, "no vertical axis"),
    ],
)
def test_what_does_not_serve_is_refused(tmp_path, change, asked, words):
    dataset = change(era5())
    for name in ("t", "z", "q"):
        if name in dataset:
            dataset[name].attrs = era5()[name].attrs
    with pytest.raises(InputError, match=words) as caught:
        read(tmp_path, dataset, **asked)
    assert "\n" not in str(caught.value)
    assert "air.nc" in str(caught.value)
