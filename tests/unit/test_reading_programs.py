"""Air as PALM, MicroHH, WRF and CF-aware programs write it: names, grids, units, gaps below the ground."""

import numpy as np
import pytest
import xarray as xr

from nigemizu.air import Atmosphere
from nigemizu.errors import InputError
from nigemizu.heat import complete, read_air, refractivity_at

NX, NY, NZ = 5, 4, 6
FILL = -999999.0


def palm(fill=FILL, declared=True, name="theta", below=0.0):
    """As `netcdf_interface_mod.f90` lays out volumes; levels 0 and, over a block, 1 are in the ground."""
    rng = np.random.default_rng(1)
    theta = (300.0 + rng.random((2, NZ, NY, NX))).astype(np.float32)
    humid = np.full((2, NZ, NY, NX), 0.01, np.float32)
    theta[:, 0], humid[:, 0] = fill, fill
    theta[:, 1, 1:3, 2], humid[:, 1, 1:3, 2] = fill, fill
    encoded = {"_FillValue": fill} if declared else {}
    volume = ("time", "zu_3d", "y", "x")
    data = xr.Dataset(
        {
            name: (volume, theta, {"long_name": name, "units": "K", **encoded}),
            "q": (volume, humid, {"long_name": "q", "units": "kg/kg", **encoded}),
            "p": (volume, rng.normal(size=theta.shape), {"long_name": "p", "units": "Pa"}),
            "u": (("time", "zu_3d", "y", "xu"), np.tile(np.arange(5.0), (2, NZ, NY, 1)), {"units": "m/s"}),
            "w": (
                ("time", "zw_3d", "y", "x"),
                np.tile(np.arange(6.0)[:, None, None], (2, 1, NY, NX)),
                {"units": "m/s"},
            ),
        },
        {
            "time": ("time", [10.0, 20.0], {"units": "seconds", "standard_name": "time", "axis": "T"}),
            "zu_3d": (
                "zu_3d",
                np.concatenate([[below], 2.0 * np.arange(NZ - 1) + 1.0]),
                {"units": "meters", "axis": "Z"},
            ),
            "zw_3d": ("zw_3d", 2.0 * np.arange(NZ), {"units": "meters", "axis": "Z"}),
            "x": ("x", 2.0 * np.arange(NX) + 1.0, {"units": "meters", "axis": "X"}),
            "y": ("y", 2.0 * np.arange(NY) + 1.0, {"units": "meters", "axis": "Y"}),
            "xu": ("xu", 2.0 * np.arange(NX), {"units": "meters", "axis": "X"}),
        },
        {"title": "PALM 23.04", "Conventions": "CF-1.7", "origin_z": 0.0},
    )
    return data, theta


def written(data, path):
    encoding = {str(name): {} for name in data.data_vars}
    data.to_netcdf(path, engine="netcdf4", encoding=encoding)
    return path


@pytest.mark.parametrize(("fill", "declared"), [(FILL, True), (FILL, False), (0.0, False), (np.nan, False)])
@pytest.mark.parametrize("name", ["theta", "pt"])
def test_palm(tmp_path, fill, declared, name):
    data, theta = palm(fill, declared, name)
    air = read_air(written(data, tmp_path / "palm_3d.nc"))
    assert set(air.data_vars) == {"air_potential_temperature", "specific_humidity"}  # p is a perturbation
    assert air["time"].values.tolist() == [10.0, 20.0]
    values = air["air_potential_temperature"].values
    assert air["air_potential_temperature"].dims == ("time", "z", "y", "x")
    # What is above the ground is as it was; what is in it is the lowest value above, column by column.
    assert np.array_equal(values[:, 2:], theta[:, 2:])
    assert np.array_equal(values[:, 0, 0, 0], theta[:, 1, 0, 0])
    assert np.array_equal(values[:, :2, 1, 2], np.repeat(theta[:, 2:3, 1, 2], 2, axis=1))
    index = refractivity_at(air, 15.0, Atmosphere())[3]
    assert 2.5e-4 < index.min() < index.max() < 2.8e-4


def test_level_of_palm_that_mirrors_the_air_into_the_ground_is_left_out(tmp_path):
    data, theta = palm(below=-1.0)
    air = read_air(written(data, tmp_path / "palm_3d.nc"))
    assert air["z"].values.tolist() == [1.0, 3.0, 5.0, 7.0, 9.0]
    assert np.array_equal(air["air_potential_temperature"].values[:, 1:], theta[:, 2:])


def test_wind_is_brought_to_the_centres_when_asked_for(tmp_path):
    data, _ = palm()
    air = read_air(written(data, tmp_path / "palm_3d.nc"), wind=True)
    assert air["x_wind"].dims == air["air_potential_temperature"].dims
    assert air["x_wind"][1, 2, 3].values.tolist() == [0.5, 1.5, 2.5, 3.5, 4.0]
    assert air["upward_air_velocity"][0, :, 0, 0].values.tolist() == [0.0, 0.5, 1.5, 2.5, 3.5, 4.5]
    assert float(air["upward_air_velocity"][0, 2, 0, 0]) == 1.5  # a part of it is the same


def test_gap_above_the_ground_is_counted(tmp_path):
    data, _ = palm()
    data["theta"][1, 4, 0, 3] = FILL
    with pytest.raises(InputError, match=r"air_potential_temperature: 1 of 240 .* time 1, z 4, y 0, x 3"):
        read_air(written(data, tmp_path / "gap.nc"))


def test_column_without_any_air_is_counted(tmp_path):
    data, _ = palm()
    data["theta"][:, :, 2, 3] = FILL
    with pytest.raises(InputError, match=rf"{2 * NZ} of 240 .* time 0, z 0, y 2, x 3"):
        read_air(written(data, tmp_path / "hole.nc"))


def microhh(variable, values, units="K", time_units="time units since start"):
    """As `3d_to_nc.py` writes one variable per file."""
    return xr.Dataset(
        {variable: (("time", "z", "y", "x"), values.astype(np.float32), {"units": units} if units else {})},
        {
            "time": ("time", np.array([0, 1800], np.int32), {"units": time_units}),
            "z": 5.0 + 10.0 * np.arange(NZ),
            "y": 5.0 + 10.0 * np.arange(NY),
            "x": 5.0 + 10.0 * np.arange(NX),
        },
    )


@pytest.mark.parametrize("way", ["folder", "pattern", "list"])
@pytest.mark.parametrize("variable", ["th", "thl"])
def test_microhh_one_file_per_variable(tmp_path, way, variable):
    rng = np.random.default_rng(2)
    warm, humid = 300.0 + rng.random((2, NZ, NY, NX)), 0.01 * rng.random((2, NZ, NY, NX))
    microhh(variable, warm, "").to_netcdf(tmp_path / f"{variable}.nc", engine="netcdf4")
    microhh("qt", humid, "kg kg-1").to_netcdf(tmp_path / "qt.nc", engine="netcdf4")
    several = [tmp_path / f"{variable}.nc", tmp_path / "qt.nc"]
    air = read_air({"folder": tmp_path, "pattern": str(tmp_path / "*.nc"), "list": several}[way])
    assert air["time"].values.tolist() == [0.0, 1800.0]
    assert air["air_potential_temperature"].values == pytest.approx(warm, rel=1e-6)
    assert air["specific_humidity"].values == pytest.approx(humid, rel=1e-6)


def test_files_that_follow_each_other_in_time(tmp_path):
    data, theta = palm()
    later = data.assign_coords(time=("time", [30.0, 40.0], data["time"].attrs))
    written(later, tmp_path / "a_3d.001.nc")
    written(data, tmp_path / "b_3d.000.nc")
    air = read_air(tmp_path)
    assert air["time"].values.tolist() == [10.0, 20.0, 30.0, 40.0]
    assert np.array_equal(air["air_potential_temperature"].values[2:, 2:], theta[:, 2:])
    whole = refractivity_at(air, 25.0, Atmosphere())[3]
    ends = [refractivity_at(read_air(tmp_path / "b_3d.000.nc"), t, Atmosphere())[3] for t in (20.0, 10.0)]
    assert whole == pytest.approx(0.5 * (ends[0] + ends[1]), rel=1e-12)
    written(later.isel(x=slice(1, None)).assign_coords(time=later["time"] + 20.0), tmp_path / "c.nc")
    with pytest.raises(InputError, match="does not continue the other"):
        read_air(tmp_path)


def test_files_that_overlap_in_time_are_refused(tmp_path):
    data, _ = palm()
    written(data, tmp_path / "a.nc")
    written(data.assign_coords(time=("time", [15.0, 40.0], data["time"].attrs)), tmp_path / "b.nc")
    with pytest.raises(InputError, match="time: the axis does not increase at index 2"):
        read_air(tmp_path)


def wrf(hill=0.0):
    rng = np.random.default_rng(3)
    shape, dims = (2, NZ, NY, NX), ("Time", "bottom_top", "south_north", "west_east")
    tall, faces = (2, NZ + 1, NY, NX), ("Time", "bottom_top_stag", "south_north", "west_east")
    base = np.broadcast_to(9.81 * 20.0 * np.arange(NZ + 1)[:, None, None], tall).copy()
    base[:, 1:, 0, 0] += 9.81 * hill
    thermal = rng.random(shape).astype(np.float32)
    return xr.Dataset(
        {
            "T": (
                dims,
                thermal,
                {"description": "perturbation potential temperature theta-t0", "units": "K"},
            ),
            "P": (dims, np.full(shape, 50.0, np.float32), {"units": "Pa"}),
            "PB": (dims, np.full(shape, 98000.0, np.float32), {"units": "Pa"}),
            "PH": (faces, np.zeros(tall, np.float32), {"units": "m2 s-2"}),
            "PHB": (faces, base.astype(np.float32), {"units": "m2 s-2"}),
            "QVAPOR": (dims, np.full(shape, 0.01, np.float32), {"units": "kg kg-1"}),
            "XTIME": (("Time",), [0.0, 5.0], {"units": "minutes since 2026-07-01"}),
        },
        attrs={"DX": 50.0, "DY": 25.0, "TITLE": " OUTPUT FROM WRF V4.5 MODEL"},
    ), thermal


def test_wrf(tmp_path):
    data, thermal = wrf()
    data.to_netcdf(tmp_path / "wrfout_d01.nc", engine="netcdf4")
    air = read_air(tmp_path / "wrfout_d01.nc")
    assert air["z"].values == pytest.approx(10.0 + 20.0 * np.arange(NZ))
    assert air["x"].values[:2].tolist() == [25.0, 75.0]
    assert air["y"].values[:2].tolist() == [12.5, 37.5]
    assert air["time"].values.tolist() == [0.0, 300.0]
    expected = (300.0 + thermal.astype(float)) * (98050.0 / 1e5) ** (2.0 / 7.0)
    assert air["air_temperature"].values == pytest.approx(expected, rel=1e-9)
    assert float(air["specific_humidity"][0, 0, 0, 0]) == pytest.approx(0.01 / 1.01)
    with pytest.raises(InputError, match=r"PH \+ PHB: the heights of level 1 differ by 30\.0 m"):
        read_air(wrf(hill=30.0)[0])


def by_standard_name(potential):
    rng = np.random.default_rng(4)
    values = rng.random((2, 3, 2, 2))
    dims = ("when", "level", "north", "east")
    return xr.Dataset(
        {
            "A": (
                dims,
                25.0 + values,
                {"standard_name": f"air_{'potential_' * potential}temperature", "units": "degC"},
            ),
            "B": (dims, 980.0 + values, {"standard_name": "air_pressure", "units": "hPa"}),
            "C": (dims, 8.0 + values, {"standard_name": "specific_humidity", "units": "g kg-1"}),
            "D": (dims, values, {"standard_name": "eastward_wind", "units": "m s-1"}),
            "E": (dims, values, {"standard_name": "y_wind", "units": "km/h"}),
        },
        {
            "when": ("when", [1.0, 2.0], {"standard_name": "time", "units": "hours since 2026-07-01 12:00"}),
            "level": ("level", [0.2, 0.1, 0.0], {"positive": "up", "units": "km"}),
            "north": ("north", [300.0, 200.0], {"axis": "Y"}),
            "east": ("east", [0.1, 0.2], {"standard_name": "projection_x_coordinate", "units": "km"}),
        },
    ), values


@pytest.mark.parametrize("potential", [False, True])
@pytest.mark.parametrize("suffix", ["nc", "zarr"])
def test_any_cf_file(tmp_path, suffix, potential):
    data, values = by_standard_name(potential)
    path = tmp_path / f"cf.{suffix}"
    data.to_netcdf(path, engine="netcdf4") if suffix == "nc" else data.to_zarr(path, consolidated=False)
    air = read_air(path, wind=True)
    assert air["z"].values == pytest.approx([0.0, 100.0, 200.0])  # turned round, as is y
    assert air["y"].values.tolist() == [200.0, 300.0]
    assert air["time"].values.tolist() == [0.0, 3600.0]
    turned = values[:, ::-1, ::-1]
    kelvin = 298.15 + turned
    if potential:
        kelvin = kelvin * (0.98 + turned / 1e3) ** (2.0 / 7.0)
    assert air["air_temperature"].values == pytest.approx(kelvin, rel=1e-12)
    assert air["air_pressure"].values == pytest.approx(98000.0 + 100.0 * turned)
    assert air["specific_humidity"].values == pytest.approx(0.008 + turned / 1e3)
    assert air["x_wind"].values == pytest.approx(turned)
    assert air["y_wind"].values == pytest.approx(turned / 3.6)


def test_axes_in_another_order_in_the_file_read_the_same(tmp_path):
    data, _ = by_standard_name(True)
    data.to_netcdf(tmp_path / "a.nc", engine="netcdf4")
    data.transpose("east", "level", "north", "when").to_netcdf(tmp_path / "b.nc", engine="netcdf4")
    one, other = read_air(tmp_path / "a.nc"), read_air(tmp_path / "b.nc")
    xr.testing.assert_identical(one.load(), other.load())


def test_what_is_written_reads_the_same(tmp_path):
    air = read_air(palm()[0])
    full = complete(air, Atmosphere())
    full.load().to_netcdf(tmp_path / "back.nc", engine="netcdf4")
    again = read_air(tmp_path / "back.nc")
    assert again["air_temperature"].values == pytest.approx(full["air_temperature"].values, rel=1e-15)
    index = [refractivity_at(dataset, 12.0, Atmosphere())[3] for dataset in (air, again)]
    assert index[0] == pytest.approx(index[1], rel=1e-9)


def test_unknown_names_say_what_is_there_and_what_would_match():
    data = xr.Dataset(
        {
            "thv": (("time", "z"), np.full((1, 3), 300.0), {"units": "K"}),
            "buoyancy": (("z",), np.zeros(3), {"units": "m s-2"}),
            **{f"s{number}": (("z",), np.zeros(3)) for number in range(15)},
        },
        {"time": [0.0], "z": [0.0, 1.0, 2.0]},
    )
    with pytest.raises(InputError) as raised:
        read_air(data)
    message = str(raised.value)
    assert "\n" not in message
    for words in (
        "thv(time, z) [K]",
        "buoyancy(z) [m s-2]",
        "and 5 more",
        "air_temperature (ta,",
        "air_potential_temperature (theta, pt, th,",
        "or air_refractivity",
        "is it 'thv'?",
    ):
        assert words in message
    assert read_air(data, names={"air_temperature": "thv"})["air_temperature"].shape == (1, 3)
    with pytest.raises(InputError, match=r"names\.air_temperature: no such variable .*'thw'.*one of thv"):
        read_air(data, names={"air_temperature": "thw"})
    with pytest.raises(InputError, match=r"names\.warmth: no such name"):
        read_air(data, names={"warmth": "thv"})


@pytest.mark.parametrize(
    "attributes",
    [
        {"units": "K", "long_name": "perturbation potential temperature"},
        {"units": "K", "long_name": "potential temperature"},
        {"units": "K", "standard_name": "air_potential_temperature"},
        {"units": "W m-2"},
    ],
)
def test_short_names_that_mean_something_else_are_not_taken_for_temperature(attributes):
    data = xr.Dataset({"T": ("z", [300.0, 301.0], attributes)}, {"z": [0.0, 1.0]})
    if attributes.get("standard_name"):
        assert "air_potential_temperature" in read_air(data)
    else:
        with pytest.raises(InputError, match=r"no variable air_temperature.*found T\(z\)"):
            read_air(data)
    plain = xr.Dataset({"T": ("z", [300.0, 301.0], {"long_name": "Absolute temperature"})}, {"z": [0.0, 1.0]})
    assert "air_temperature" in read_air(plain)


def test_packed_whole_numbers_below_the_ground():
    packed = np.array([[-9999, 2500, 2600], [2400, 2450, 2475]], np.int16)
    data = xr.Dataset(
        {"ta": (("x", "z"), packed, {"units": "K", "scale_factor": 0.1, "_FillValue": np.int16(-9999)})},
        {"x": [0.0, 1.0], "z": [0.0, 1.0, 2.0]},
    )
    air = read_air(xr.decode_cf(data))
    assert air["air_temperature"].values == pytest.approx(
        np.array([[250.0, 240.0], [250.0, 245.0], [260.0, 247.5]]), rel=1e-6
    )
    whole = xr.Dataset({"ta": ("z", np.array([-9999, 300, 299], np.int16))}, {"z": [0.0, 1.0, 2.0]})
    assert read_air(whole)["air_temperature"].values.tolist() == [300.0, 300.0, 299.0]
