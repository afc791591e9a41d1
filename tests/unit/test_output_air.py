"""Air to files and back: every bit, instant by instant, whole or not at all."""

import errno
import os

import netCDF4
import numpy as np
import pytest
import xarray as xr

from nigemizu.errors import InputError, MachineError
from nigemizu.heat import read_air
from nigemizu.output import write_air


def air(times=(0.0, 5.0, 20.0), nz=4):
    generator = np.random.default_rng(3)
    count = len(times)
    return xr.Dataset(
        {
            "air_temperature": (
                ("time", "z", "y", "x"),
                300 + generator.normal(size=(count, nz, 3, 5)),
                {"units": "K", "standard_name": "air_temperature"},
            ),
            "surface_temperature": (
                ("time", "y", "x"),
                320 + generator.normal(size=(count, 3, 5)),
                {"units": "K"},
            ),
            "air_pressure": (("time", "z"), 1e5 + generator.normal(size=(count, nz)), {"units": "Pa"}),
            "z_bounds": (("z", "bounds"), np.zeros((nz, 2))),
        },
        {
            "time": ("time", np.array(times), {"units": "s", "axis": "T"}),
            "z": ("z", np.arange(nz) + 0.5, {"units": "m", "bounds": "z_bounds"}),
            "y": ("y", np.arange(3.0)),
            "x": ("x", np.arange(5.0)),
        },
        {"Conventions": "CF-1.11", "nigemizu_scene": 'title = "Wüste"'},
    )


def instants(data):
    return (data.isel(time=slice(index, index + 1)) for index in range(data.sizes["time"]))


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
@pytest.mark.parametrize("cut", [lambda data: data, instants], ids=["whole", "stream"])
def test_there_and_back(tmp_path, suffix, cut):
    path = write_air(cut(air()), tmp_path / f"air{suffix}")
    with xr.open_dataset(path) as back:  # as anyone opens it, and without a warning
        xr.testing.assert_identical(back.load(), air())
    assert [file.name for file in tmp_path.iterdir()] == [f"air{suffix}"]
    read = read_air(path)
    assert np.array_equal(read["air_temperature"], air()["air_temperature"])


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_air_that_does_not_change(tmp_path, suffix):
    still = air().isel(time=0, drop=True)
    read = read_air(write_air(still, tmp_path / f"air{suffix}"))
    assert np.array_equal(read["air_temperature"], still["air_temperature"])
    assert "time" not in read.dims


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_only_one_instant_is_held(tmp_path, suffix):
    """The next instant is asked for only after the one before was written: none piles up."""
    asked = []

    def stream():
        for index, instant in enumerate(instants(air())):
            asked.append((index, sum(file.stat().st_size for file in tmp_path.rglob("*") if file.is_file())))
            yield instant

    write_air(stream(), tmp_path / f"air{suffix}")
    assert [index for index, _ in asked] == [0, 1, 2]
    assert asked[0][1] == 0 < asked[1][1]


def test_other_programs_see_a_time_that_can_grow(tmp_path):
    with netCDF4.Dataset(write_air(instants(air()), tmp_path / "air.nc")) as store:
        assert store.dimensions["time"].isunlimited()
        assert store.data_model == "NETCDF4"
        assert store["air_temperature"].filters()["zlib"]
        assert "_FillValue" not in store["time"].ncattrs()


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_old_air_is_replaced_only_by_whole_air(tmp_path, suffix):
    path = write_air(air(), tmp_path / f"air{suffix}")

    def interrupted():
        yield air().isel(time=slice(0, 1))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_air(interrupted(), path)
    assert read_air(path).sizes["time"] == 3
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    write_air(air((0.0, 1.0)), path)
    assert read_air(path).sizes["time"] == 2


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_instants_must_fit_together(tmp_path, suffix):
    with pytest.raises(InputError, match="does not fit the first one"):
        write_air([air((0.0,)), air((1.0,), nz=5)], tmp_path / f"air{suffix}")
    with pytest.raises(InputError, match="does not fit the first one"):
        write_air([air((0.0,)), air((1.0,)).drop_vars("air_pressure")], tmp_path / f"air{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_refused(tmp_path):
    with pytest.raises(InputError, match=r"'\.csv'.*expected \.zarr or \.nc"):
        write_air(air(), tmp_path / "air.csv")
    with pytest.raises(InputError, match="no air to write"):
        write_air([], tmp_path / "air.nc")
    (tmp_path / "file").write_text("a file")
    for suffix in (".zarr", ".nc"):
        with pytest.raises(InputError, match="cannot be written"):
            write_air(air(), tmp_path / "file" / f"air{suffix}")


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_full_disk_leaves_nothing(tmp_path, suffix, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace" if suffix == ".nc" else "rename", full)
    with pytest.raises(MachineError, match=f"air{suffix}: the disk is full"):
        write_air(air(), tmp_path / f"air{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_full_disk_inside_the_netcdf_library(tmp_path, monkeypatch):
    """HDF5 reports a full disk as a RuntimeError without a number."""

    def full(*_, **__):
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", full)
    with pytest.raises(MachineError, match="HDF error; is the disk full"):
        write_air(air(), tmp_path / "air.nc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_trouble_of_the_maker_is_not_taken_for_a_full_disk(tmp_path, suffix):
    def failing():
        yield air().isel(time=slice(0, 1))
        raise RuntimeError("the solver broke down")

    with pytest.raises(RuntimeError, match="the solver broke down"):
        write_air(failing(), tmp_path / f"air{suffix}")
    assert list(tmp_path.iterdir()) == []
