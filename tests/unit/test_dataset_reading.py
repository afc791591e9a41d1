"""Reading air from elsewhere: what is recognised, and what is refused with a reason."""

import numpy as np
import pytest
import xarray as xr

from nigemizu.errors import InputError
from nigemizu.heat import read_air

X, Y, Z = np.arange(4.0), np.arange(3.0), np.array([0.1, 0.3, 1.0])


def foreign(**changes):
    """A dataset as another program would write it."""
    values = 20.0 + np.arange(72.0).reshape(2, 3, 3, 4) / 10.0
    data = xr.Dataset(
        {
            "T": (
                ("t", "height", "north", "east"),
                values,
                {"standard_name": "air_temperature", "units": "degC"},
            )
        },
        {
            "t": ("t", [0.0, 2.0], {"units": "minutes"}),
            "height": ("height", 100 * Z, {"units": "cm"}),
            "north": ("north", Y, {"axis": "Y", "units": "m"}),
            "east": ("east", X / 1e3, {"standard_name": "projection_x_coordinate", "units": "km"}),
        },
    )
    return data.assign(**changes)


def test_names_units_and_order_are_brought_home():
    air = read_air(foreign().transpose("east", "north", "height", "t"))
    assert air["air_temperature"].dims == ("time", "z", "y", "x")
    assert float(air["air_temperature"][1, 2, 2, 3]) == pytest.approx(293.15 + 7.1)
    assert air["air_temperature"].attrs["units"] == "K"
    assert air["time"].values.tolist() == [0.0, 120.0]
    assert air["z"].values == pytest.approx(Z)
    assert air["x"].values == pytest.approx(X)


@pytest.mark.parametrize(
    ("units", "value", "kelvin"),
    [("K", 300.0, 300.0), ("", 300.0, 300.0), ("celsius", 26.85, 300.0), ("degF", 80.33, 300.0)],
)
def test_units_of_temperature(units, value, kelvin):
    air = read_air(xr.Dataset({"air_temperature": ("z", [value] * 3, {"units": units})}, {"z": Z}))
    assert air["air_temperature"].values == pytest.approx([kelvin] * 3)


def test_other_variables_come_along():
    shape = (2, 3, 3, 4)
    dims = ("t", "height", "north", "east")
    data = foreign(
        p=(dims, np.full(shape, 990.0), {"standard_name": "air_pressure", "units": "hPa"}),
        rh=(dims, np.full(shape, 40.0), {"standard_name": "relative_humidity", "units": "%"}),
        skin=(
            ("t", "north", "east"),
            np.full((2, 3, 4), 55.0),
            {"standard_name": "surface_temperature", "units": "degC"},
        ),
        u=(dims, np.zeros(shape), {"standard_name": "x_wind", "units": "m s-1"}),
    )
    air = read_air(data)
    assert set(air.data_vars) == {
        "air_temperature",
        "air_pressure",
        "relative_humidity",
        "surface_temperature",
    }
    assert float(air["air_pressure"][0, 0, 0, 0]) == 99000.0
    assert float(air["relative_humidity"][0, 0, 0, 0]) == pytest.approx(0.4)
    assert float(air["surface_temperature"][0, 0, 0]) == pytest.approx(328.15)


def test_dates_become_seconds(tmp_path):
    times = np.array(["2026-07-01T12:00", "2026-07-01T13:30"], "M8[ns]")
    data = foreign().drop_vars("t").assign_coords(t=times)
    assert read_air(data)["time"].values.tolist() == [0.0, 5400.0]
    data.to_netcdf(tmp_path / "dates.nc", engine="netcdf4")
    assert read_air(tmp_path / "dates.nc")["time"].values.tolist() == [0.0, 5400.0]


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_files_are_read_like_datasets(tmp_path, suffix):
    path = tmp_path / f"air{suffix}"
    if suffix == ".nc":
        foreign().to_netcdf(path, engine="netcdf4")
    else:
        foreign().to_zarr(path, consolidated=False)
    xr.testing.assert_allclose(read_air(path), read_air(foreign()))


def test_consolidated_second_format_of_zarr(tmp_path):
    foreign().to_zarr(tmp_path / "old.zarr", zarr_format=2, consolidated=True)
    assert read_air(tmp_path / "old.zarr")["air_temperature"].shape == (2, 3, 3, 4)


def with_gap():
    data = foreign()
    data["T"][1, 2, 0, 3] = np.nan
    data["T"][1, 2, 1, 3] = np.inf
    return data


def plain(values, units="K", **coordinates):
    dims = tuple(coordinates)
    return xr.Dataset({"air_temperature": (dims, values, {"units": units})}, coordinates)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (with_gap, ["air_temperature", "2 of 72", "time 1, z 2, y 0, x 3"]),
        (
            lambda: xr.Dataset({"air_temprature": ("z", [300.0] * 3), "u": ("z", [0.0] * 3)}, {"z": Z}),
            ["no variable air_temperature", "air_temprature(z), u(z)", "is it 'air_temprature'?"],
        ),
        (lambda: xr.Dataset(), ["no variable at all"]),
        (lambda: plain([300.0] * 3, z=[0.0, 2.0, 1.0]), ["z", "does not increase at index 2", "sort it"]),
        (lambda: plain([300.0] * 3, z=[0.0, 1.0, 1.0]), ["z", "does not increase at index 2"]),
        (lambda: plain([300.0] * 3, z=[0.0, np.nan, 1.0]), ["z", "not finite at index 1"]),
        (lambda: plain([300.0] * 3, units="m", z=Z), ["air_temperature", "'m'", "a temperature (K, degC)"]),
        (lambda: plain([25.0] * 3, z=Z), ["air_temperature", "no air has", "25.0", "check the units"]),
        (lambda: plain([300.0] * 3, x=X[:3]), ["no height axis", "x"]),
        (lambda: plain(np.full((3, 3), 300.0), z=Z, foo=Y), ["foo", "cannot tell what this axis is"]),
        (lambda: plain(np.full((3, 3), 300.0), z=Z, longitude=Y), ["longitude", "metres"]),
        (lambda: plain(np.full((3, 3), 300.0), z=Z, height=Y), ["height", "two axes are z"]),
        (
            lambda: plain([300.0] * 3, z=Z).drop_vars("z"),
            ["z", "no coordinate values"],
        ),
        (
            lambda: plain([300.0] * 3, z=("z", Z, {"units": "hPa"})),
            ["z", "'hPa'", "lengths"],
        ),
        (lambda: plain([300.0] * 3, z=("z", Z, {"positive": "down"})), ["z", "points down"]),
        (lambda: plain(["warm"] * 3, z=Z), ["air_temperature", "not numbers"]),
        (lambda: plain(np.empty(0), z=np.empty(0)), ["air_temperature", "no values"]),
        (
            lambda: plain(np.full((1, 3), 300.0), time=[np.datetime64("NaT", "ns")], z=Z),
            ["time", "no date at index 0"],
        ),
        (
            lambda: plain(np.full((1, 3), 300.0), time=("time", [0.0], {"units": "K"}), z=Z),
            ["time", "'K'", "durations"],
        ),
        (
            lambda: foreign(S=foreign()["T"]),
            ["several variables", "T, S", "name the right one"],
        ),
        (
            lambda: foreign(
                p=(("level",), [9e4, 8e4], {"standard_name": "air_pressure"}),
            ).assign_coords(level=("level", [0.0, 1.0], {"axis": "Z"})),
            ["different axes"],
        ),
    ],
)
def test_refused_with_a_reason(data, words):
    with pytest.raises(InputError) as raised:
        read_air(data())
    message = str(raised.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_files_that_are_no_datasets(tmp_path):
    with pytest.raises(InputError, match=r"missing\.nc: no such file"):
        read_air(tmp_path / "missing.nc")
    text = tmp_path / "text.nc"
    text.write_text("not a dataset")
    with pytest.raises(InputError, match=r"text\.nc: not a dataset"):
        read_air(text)
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(InputError, match=r"empty\.zarr: not a dataset"):
        read_air(tmp_path / "empty.zarr")


def test_errors_name_the_file(tmp_path):
    with_gap().to_netcdf(tmp_path / "gap.nc", engine="netcdf4")
    with pytest.raises(InputError, match=r"gap\.nc: air_temperature: 2 of 72"):
        read_air(tmp_path / "gap.nc")


def test_values_stay_in_the_file_until_used(tmp_path):
    plain(np.full((2, 3), 300.0), time=[0.0, 1.0], z=Z).to_netcdf(tmp_path / "air.nc", engine="netcdf4")
    assert not read_air(tmp_path / "air.nc")["air_temperature"]._in_memory


@pytest.mark.parametrize("suffix", ["nc", "zarr"])
def test_an_instant_larger_than_memory_is_refused_before_it_is_read(tmp_path, suffix):
    path = tmp_path / f"air.{suffix}"
    foreign().to_netcdf(path) if suffix == "nc" else foreign().to_zarr(path, consolidated=False)
    # 36 values an instant, in four copies of 8 bytes
    assert read_air(path, available=lambda: 36 * 32)["air_temperature"].size == 72
    with pytest.raises(InputError, match=r"T: one instant of 36 values needs .* cut out or coarsen"):
        read_air(path, available=lambda: 36 * 32 - 1)
