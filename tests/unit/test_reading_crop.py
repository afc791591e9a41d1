"""Cutting a box out of the air: the same as slicing, and nothing outside is read."""

import numpy as np
import pytest
import xarray as xr

from nigemizu.air import Atmosphere
from nigemizu.errors import InputError
from nigemizu.heat import read_air, refractivity_at
from nigemizu.heat.reading.crop import split_crop


def cube(falling=False):
    rng = np.random.default_rng(5)
    data = xr.Dataset(
        {
            "theta": (
                ("time", "zu_3d", "y", "x"),
                290.0 + rng.random((5, 8, 6, 7)),
                {"units": "K"},
            ),
            "skin": (
                ("time", "y", "x"),
                310.0 + rng.random((5, 6, 7)),
                {"standard_name": "surface_temperature", "units": "K"},
            ),
        },
        {
            "time": ("time", 30.0 * np.arange(5), {"units": "minutes"}),
            "zu_3d": 1.0 + 2.0 * np.arange(8.0),
            "y": ("y", 0.01 * np.arange(6), {"units": "km"}),
            "x": 10.0 * np.arange(7),
        },
    )
    return data.isel(x=slice(None, None, -1), zu_3d=slice(None, None, -1)) if falling else data


BOX = {"x": (15.0, 40.0), "y": (None, 20.0), "z": (3.0, None), "time": (1800.0, 5400.0)}
WORDS = "@x=15:40,y=:20,z=3:,time=1800:5400"


@pytest.mark.parametrize("falling", [False, True])
@pytest.mark.parametrize("way", ["keys", "words", "dataset"])
@pytest.mark.parametrize("suffix", ["nc", "zarr"])
def test_cropping_is_slicing(tmp_path, suffix, way, falling):
    data, path = cube(falling), tmp_path / f"air.{suffix}"
    data.to_netcdf(path, engine="netcdf4") if suffix == "nc" else data.to_zarr(path, consolidated=False)
    if way == "words":
        cropped = read_air(f"{path}{WORDS}")
    else:
        cropped = read_air(data if way == "dataset" else path, crop=BOX)
    sliced = read_air(path).sel(
        x=slice(15.0, 40.0), y=slice(None, 20.0), z=slice(3.0, None), time=slice(1800.0, 5400.0)
    )
    assert dict(cropped.sizes) == {"time": 3, "z": 7, "y": 3, "x": 3}
    xr.testing.assert_equal(cropped.load(), sliced.load())
    # The clock stays that of the whole file.
    index = [refractivity_at(air, 2700.0, Atmosphere())[3] for air in (cropped, sliced)]
    assert np.array_equal(*index)


class Watched(xr.backends.BackendArray):
    """An array that remembers which of its values were asked for."""

    def __init__(self, values):
        self.values, self.shape, self.dtype = values, values.shape, values.dtype
        self.read = np.zeros(values.shape, bool)

    def __getitem__(self, key):
        from xarray.core import indexing

        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key):
        full = np.ix_(
            *[np.atleast_1d(np.arange(size)[part]) for size, part in zip(self.shape, key, strict=True)]
        )
        self.read[full] = True
        shape = [
            size for size, part in zip(self.values[full].shape, key, strict=True) if not np.isscalar(part)
        ]
        return self.values[full].reshape(shape)


def watched():
    from xarray.core import indexing

    data = cube()
    array = Watched(data["theta"].values)
    variable = xr.Variable(data["theta"].dims, indexing.LazilyIndexedArray(array), data["theta"].attrs)
    return data.assign(theta=variable), array


def test_nothing_outside_the_box_is_read():
    data, array = watched()
    read_air(data, crop=BOX)["air_potential_temperature"].load()
    inside = np.zeros_like(array.read)
    inside[1:4, 1:, :3, 2:5] = True
    assert np.array_equal(array.read, inside)


def test_only_the_two_instants_around_the_time_are_read(monkeypatch):
    monkeypatch.setattr("nigemizu.heat.reading.values._LOOKED_AT", 0)
    monkeypatch.setattr("nigemizu.heat.reading._called", lambda _: "air.nc")
    data, array = watched()
    monkeypatch.setattr("nigemizu.heat.reading.open_dataset", lambda _: data)
    air = read_air("air.nc")
    assert array.read[0].all()
    assert not array.read[1:].any()  # of much air, only the first instant is looked at
    refractivity_at(air, 4000.0, Atmosphere())
    assert array.read[[2, 3]].all()
    assert not array.read[[1, 4]].any()


def test_much_air_is_looked_at_when_it_is_used(tmp_path, monkeypatch):
    monkeypatch.setattr("nigemizu.heat.reading.values._LOOKED_AT", 0)
    data = cube()
    data["theta"][2, 5, 4, 3], data["theta"][2, 6, 4, 3], data["theta"][3, 0, 0, 0] = np.nan, np.inf, 9e9
    data.to_netcdf(tmp_path / "air.nc", engine="netcdf4")
    air = read_air(tmp_path / "air.nc")
    refractivity_at(air, 900.0, Atmosphere())
    with pytest.raises(InputError, match=r"air\.nc: .*: 2 of 336 .* time 2, z 5, y 4, x 3"):
        refractivity_at(air, 1900.0, Atmosphere())
    with pytest.raises(InputError, match=r"air\.nc: .*: values that no air has .*9e\+09|9000000000"):
        air["air_potential_temperature"].isel(time=3).load()


def test_gap_outside_the_box_does_not_matter():
    data = cube()
    data["theta"][0, 7, 5, 6] = np.nan
    with pytest.raises(InputError, match="1 of 1680"):
        read_air(data)
    assert read_air(data, crop={"x": (None, 50.0)}).sizes["x"] == 6


@pytest.mark.parametrize(
    ("crop", "words"),
    [
        ({"x": (100.0, 200.0)}, ["crop.x", "nothing lies", "0 to 60 m", "next to it 60"]),
        ({"x": (11.0, 12.0)}, ["crop.x", "next to it 10 and 20"]),
        ({"x": (5.0, 1.0)}, ["crop.x", "not a range", "low to high"]),
        ({"x": (5.0, float("nan"))}, ["crop.x", "not a range"]),
        ({"x": 5.0}, ["crop.x", "not a range"]),
        ({"x": (1.0, 2.0, 3.0)}, ["crop.x", "not a range"]),
        ({"height": (0.0, 1.0)}, ["height", "no such axis", "x, y, z or time"]),
    ],
)
def test_boxes_that_are_none(crop, words):
    with pytest.raises(InputError) as raised:
        read_air(cube(), crop=crop)
    for word in words:
        assert word in str(raised.value)


def test_axis_that_the_air_does_not_have():
    profile = xr.Dataset({"air_temperature": ("z", [300.0, 299.0])}, {"z": [0.0, 1.0]})
    with pytest.raises(InputError, match=r"crop\.x: the air has no such axis"):
        read_air(profile, crop={"x": (0.0, 1.0)})


@pytest.mark.parametrize(
    ("text", "path", "crop"),
    [
        ("les.nc", "les.nc", {}),
        ("a@b/les.nc", "a@b/les.nc", {}),
        ("a@b/les.nc@z=:-1e1", "a@b/les.nc", {"z": (None, -10.0)}),
        ("les.nc@x=.5:", "les.nc", {"x": (0.5, None)}),
        ("les.nc@home", "les.nc@home", {}),
    ],
)
def test_words_of_a_box(text, path, crop):
    assert split_crop(text) == (path, crop)


def test_file_of_that_name_is_meant_as_it_is(tmp_path):
    path = str(tmp_path / "air.nc@x=0:1")
    cube().to_netcdf(path, engine="netcdf4")
    assert read_air(path).sizes["x"] == 7


def test_axis_cropped_twice():
    with pytest.raises(InputError, match="cropped twice"):
        split_crop("les.nc@x=0:1,x=2:3")


@pytest.mark.parametrize(
    ("units", "values", "seconds"),
    [
        ("seconds", [10.0, 20.0], [10.0, 20.0]),
        ("minutes", [0.5, 1.0], [30.0, 60.0]),
        ("hours since 2026-07-01 00:00:00 +00", [6.0, 7.5], [0.0, 5400.0]),
        ("days since 2026-07-01", [0.25, 0.5], [0.0, 21600.0]),
        ("time units since start", [0.0, 1800.0], [0.0, 1800.0]),
        ("", [3.0, 4.0], [3.0, 4.0]),
    ],
)
def test_units_of_time(units, values, seconds):
    data = xr.Dataset(
        {"air_temperature": (("time", "z"), np.full((2, 2), 300.0))},
        {"time": ("time", values, {"units": units}), "z": [0.0, 1.0]},
    )
    assert read_air(data)["time"].values.tolist() == seconds
