"""The temperature at the beginning: formulas, tables, datasets, unevenness."""

import math

import numpy as np
import pytest
import xarray as xr
from pydantic import ValidationError

from nigemizu.errors import InputError
from nigemizu.heat import GridSpec, Initial, ProfileTable, Unevenness
from nigemizu.heat.formula import evaluate_formula

GRID = GridSpec(x=(0, 32), y=(0, 16), height=4, cells=(64, 32, 40)).build()
UNEVEN = {"amplitude": 2.0, "length": (1.5, 1.0, 0.25)}


def test_formula_is_evaluated_as_written():
    z = np.array([0.0, 0.1, 2.0])
    written = "300 + 20*exp(-z/0.1) - 6.5e-3*z^2 + erfc(z)*max(z, 1) + sqrt(4)*pi - tanh(-z)"
    expected = [
        300 + 20 * math.exp(-h / 0.1) - 6.5e-3 * h**2 + math.erfc(h) * max(h, 1) + 2 * math.pi + math.tanh(h)
        for h in z
    ]
    np.testing.assert_allclose(evaluate_formula(written, "z", z), expected, rtol=1e-14)
    assert evaluate_formula("300", "z", z).tolist() == [300.0] * 3


@pytest.mark.parametrize(
    ("formula", "words"),
    [
        ("__import__('os')", "unknown function '__import__'"),
        ("z.real", "not allowed"),
        ("(lambda: 1)()", "not allowed"),
        ("[1, 2]", "not allowed"),
        ("'300'", "not allowed"),
        ("True", "not allowed"),
        ("exp(z, 2)", "takes 1 argument"),
        ("300 + y", "unknown name 'y'"),
        ("300 +", "cannot read"),
        ("z if z else 1", "not allowed"),
    ],
)
def test_formulas_that_are_refused(formula, words):
    with pytest.raises(ValidationError, match=words):
        Initial(profile=formula)


@pytest.mark.parametrize("formula", ["-300", "300 + log(z - 3)", "300/(z - z)", "1e308*10*(1+z)"])
def test_temperatures_that_make_no_sense_are_refused(formula):
    with pytest.raises(InputError, match="finite and above 0 K"):
        Initial(profile=formula).sample(GRID)


def test_profile_table_is_linear_and_constant_beyond():
    table = ProfileTable(heights=(1, 2), temperatures=(310, 300))
    volume = Initial(profile=table).sample(GRID)
    np.testing.assert_allclose(volume[:, 3, 5], np.interp(GRID.z, [1, 2], [310, 300]))
    assert np.ptp(volume, axis=(1, 2)).max() == 0


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({}, "exactly one"),
        ({"temperature": 300, "profile": "300"}, "exactly one"),
        ({"temperature": -1}, "greater than 0"),
        ({"temperature": 300, "dataset_time": 1.0}, "only with dataset"),
        ({"profile": {"heights": (0, 1), "temperatures": (300, -1)}}, "above zero"),
        ({"profile": {"heights": (1, 0), "temperatures": (300, 301)}}, "increase"),
        ({"temperature": 300, "unevenness": [{**UNEVEN, "length": (1, 0, 1)}]}, "above zero"),
        ({"temperature": 300, "unevenness": [{**UNEVEN, "amplitude": 0}]}, "greater than 0"),
    ],
)
def test_beginnings_that_are_refused(data, words):
    with pytest.raises(ValidationError, match=words):
        Initial.model_validate(data)


def test_a_volume_beyond_the_memory_is_refused_before_it_is_made():
    with pytest.raises(InputError, match=r"grid\.cells"):
        Initial(temperature=300).sample(GRID, available=lambda: 1000)


def test_dataset_is_interpolated_linearly(tmp_path):
    def field(t, z, y, x):
        return 300 + 2 * x - y + 3 * z + 0.5 * t

    axes = {"time": [0.0, 10.0], "z": [0.0, 1.5, 5.0], "y": [-1.0, 20.0], "x": [-1.0, 7.0, 40.0]}
    t, z, y, x = np.meshgrid(*axes.values(), indexing="ij")
    attributes = {"z": "m", "y": "m", "x": "m", "time": "s"}
    data = xr.Dataset({"air_temperature": (tuple(axes), field(t, z, y, x), {"units": "K"})}, coords=axes)
    for name, unit in attributes.items():
        data[name].attrs["units"] = unit
    data.to_netcdf(tmp_path / "air.nc")
    volume = Initial(dataset=tmp_path / "air.nc", dataset_time=4.0).sample(GRID)
    expected = field(4.0, GRID.z[:, None, None], GRID.y[:, None], GRID.x)
    np.testing.assert_allclose(volume, expected, rtol=1e-12)
    first = Initial(dataset=tmp_path / "air.nc").sample(GRID)
    np.testing.assert_allclose(volume - first, 2.0, rtol=1e-9)
    with pytest.raises(InputError, match="dataset_time"):
        Initial(dataset=tmp_path / "air.nc", dataset_time=99.0).sample(GRID)


# --- unevenness ---------------------------------------------------------------------------------------


def test_unevenness_has_the_chosen_amplitude_and_lengths():
    fields = np.array([Unevenness(**UNEVEN, seed=seed).sample(GRID) for seed in range(16)])
    # 16 boxes with some 32·16·4 / ((2π)^1.5 1.5·1·0.25) = 350 independent blobs: variance known to about
    # sqrt(2 / 5600) = 1.9 percent, its root to 1 percent; three of these are allowed
    assert abs(np.std(fields) / 2.0 - 1) < 0.03
    for axis, lag, length in ((3, 3, 1.5), (2, 2, 1.0), (1, 2, 0.25)):
        step = {3: 0.5, 2: 0.5, 1: 0.1}[axis]
        shifted = np.take(fields, range(lag, fields.shape[axis]), axis=axis)
        still = np.take(fields, range(fields.shape[axis] - lag), axis=axis)
        correlation = np.mean(shifted * still) / 4.0
        assert abs(correlation - math.exp(-0.5 * (lag * step / length) ** 2)) < 0.04
    assert np.abs(fields.mean(axis=(2, 3))).max() < 1e-12  # the mean profile is left alone


def test_unevenness_is_periodic():
    field = Unevenness(**UNEVEN, seed=3).sample(GRID)
    inside = np.abs(np.diff(field, axis=2)).mean()
    across = np.abs(field[:, :, 0] - field[:, :, -1]).mean()
    assert 0.7 < across / inside < 1.3


def test_unevenness_depends_on_the_seed_alone():
    first, again, other = (Unevenness(**UNEVEN, seed=seed).sample(GRID) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first, again)
    assert abs(np.mean(first * other)) < 0.4
    # the same air on finer cells and in a higher box: cell centres coincide at every third cell
    finer = GridSpec(x=(0, 32), y=(0, 16), height=4, cells=(192, 96, 120)).build()
    np.testing.assert_allclose(
        Unevenness(**UNEVEN, seed=7).sample(finer)[1::3, 1::3, 1::3], first, atol=1e-10
    )
    higher = GridSpec(x=(0, 32), y=(0, 16), height=6, cells=(64, 32, 60)).build()
    np.testing.assert_allclose(Unevenness(**UNEVEN, seed=7).sample(higher)[:40], first, atol=1e-10)


def test_unevenness_dies_away_with_height():
    fading = Unevenness(**UNEVEN, seed=7, depth=0.5).sample(GRID)
    full = Unevenness(**UNEVEN, seed=7).sample(GRID)
    np.testing.assert_allclose(fading, full * np.exp(-GRID.z / 0.5)[:, None, None])


@pytest.mark.parametrize(
    ("length", "words"),
    [
        ((0.9, 2, 1), r"0\.9 m along x is under two cells of 0\.5 m"),
        ((2, 0.9, 1), "along y"),
        ((2, 2, 0.15), r"along z is under two cells of 0\.1 m"),
        ((200, 200, 1), "box is too small"),
    ],
)
def test_lengths_that_the_cells_cannot_hold_are_refused(length, words):
    with pytest.raises(InputError, match=words):
        Unevenness(amplitude=1.0, length=length).sample(GRID)


def test_unevenness_is_added_to_the_profile():
    both = Initial(
        profile="300 + z",
        unevenness=(Unevenness(**UNEVEN, seed=1), Unevenness(amplitude=0.5, length=(4, 4, 1), seed=2)),
    )
    parts = [uneven.sample(GRID) for uneven in both.unevenness]
    expected = (300 + GRID.z)[:, None, None] + parts[0] + parts[1]
    np.testing.assert_allclose(both.sample(GRID), expected)
