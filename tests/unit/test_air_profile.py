"""Profiles: smooth between their breaks, honest about their derivative, and what they refuse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nigemizu import InputError
from nigemizu.air import Atmosphere, Earth, ExponentialLayer, GaussianLayer, Inversion, Profile, ProfileSpec
from nigemizu.air.courses import Linear, Smooth

HEIGHTS = (0.0, 30.0, 50.0, 11000.0)
TEMPERATURES = (288.0, 287.8, 288.6, 217.4)
TABLE: dict[str, Any] = {"kind": "table", "heights": HEIGHTS, "temperatures": TEMPERATURES}
SPECS: dict[str, dict[str, Any]] = {
    "standard": {"kind": "us1976"},
    "warm and moist": {"kind": "us1976", "surface_temperature": 300.0, "relative_humidity": 0.7},
    "layers": {
        "kind": "isa",
        "layers": (
            Inversion(jump=5.0, height=30.0, thickness=4.0, decay=300.0),
            ExponentialLayer(excess=8.0, height=0.2),
            GaussianLayer(excess=1.2, height=23.0, width=3.0),
        ),
    },
    "lines": {**TABLE, "smoothing": 0.0},
    "rounded": {**TABLE, "smoothing": 4.0},
    "cubics": {**TABLE, "relative_humidities": (0.9, 0.8, 0.7, 0.1)},
    "surface layer": {
        "kind": "us1976",
        "surface_layer": {"ground_temperature": 278.15, "air_temperature": 274.15, "wind": 3.0},
    },
}


def build(name: str) -> Profile:
    return ProfileSpec(**SPECS[name]).build(Earth())


@pytest.mark.parametrize("name", SPECS)
def test_the_slope_is_the_derivative(name: str) -> None:
    profile = build(name)
    index = profile.index(Atmosphere())
    heights = np.array([0.05, 0.7, 3.0, 22.0, 29.5, 41.0, 333.0, 4321.0, 15e3, 60e3])
    step = 1e-4 * heights
    rise = (index(heights + step)[0] - index(heights - step)[0]) / (2 * step)
    _, slope = index(heights)
    np.testing.assert_allclose(slope, rise, rtol=2e-5, atol=2e-13)


@pytest.mark.parametrize("name", SPECS)
def test_cubics_through_the_nodes_are_close(name: str) -> None:
    """What `nodes` promises, looked at in other places than where it looks itself."""
    profile = build(name)
    index, nodes = profile.index(Atmosphere()), profile.nodes(1e-11)
    width = np.diff(nodes)
    wide = width > 0.05
    begin, end = index(nodes[:-1]), index(nodes[1:] - 1e-7)
    rise = end[0] - begin[0]
    first, last = begin[1] * width, end[1] * width
    for w in (0.13, 0.37, 0.61, 0.91):
        cubic = (first + w * (2 * (3 * rise - 2 * first - last) + w * 3 * (first + last - 2 * rise))) / width
        wrong = np.abs(cubic - index(nodes[:-1] + w * width)[1])[wide]
        assert wrong.max() < 3e-11
    assert len(profile.nodes(1e-13)) > len(nodes)
    assert np.all(np.diff(nodes) > 0)
    assert nodes[0] == 0.0


def test_corners_are_rounded_over_their_width_and_no_farther() -> None:
    heights, values = np.array(HEIGHTS), np.array(TEMPERATURES)
    sharp, rounded = Linear(heights, values), Linear(heights, values, 4.0)
    away = np.array([5.0, 27.9, 32.1, 47.9, 52.1, 9000.0])
    np.testing.assert_allclose(rounded.value_and_slope(away), sharp.value_and_slope(away), rtol=1e-12)
    at = rounded.value_and_slope(np.array([30.0]))[0] - sharp.value_and_slope(np.array([30.0]))[0]
    # Half of the slopes' jump times w/2 times r(0) = 5/32.
    assert float(at[0]) == pytest.approx((0.8 / 20 + 0.2 / 30) * 2.0 * 5 / 32, rel=1e-12)


def test_cubics_make_no_extremes_of_their_own() -> None:
    heights, values = np.array([0.0, 1.0, 2.0, 3.0, 10.0]), np.array([300.0, 290.0, 290.0, 295.0, 295.0])
    found, _ = Smooth(heights, values).value_and_slope(np.linspace(0, 10, 2001))
    assert found.min() >= 290.0
    assert found.max() <= 300.0
    np.testing.assert_allclose(Smooth(heights, values).value_and_slope(heights)[0], values)


def test_a_table_goes_on_as_the_standard() -> None:
    spec = ProfileSpec(kind="table", heights=(0.0, 100.0), temperatures=(280.0, 285.0))
    profile = spec.build(Earth())
    standard = ProfileSpec().build(Earth())
    assert profile.measured_top == 100.0
    assert profile.notes
    assert profile.at(100.0)[0] == pytest.approx(285.0)
    assert profile.at(20e3)[0] == pytest.approx(float(standard.at(20e3)[0]), abs=0.01)
    still = spec.model_copy(update={"beyond": "isothermal"}).build(Earth())
    assert still.at(20e3)[0] == pytest.approx(285.0)


def test_a_surface_layer_has_its_temperatures() -> None:
    profile = build("surface layer")
    assert profile.at(2.0)[0] == pytest.approx(274.15, abs=1e-6)
    assert profile.at(0.0)[0] == pytest.approx(278.15, abs=0.05)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"heights": (0.0, 50.0, 30.0, 11000.0)}, ("row 3", "heights", "30")),
        ({"heights": (0.0, 30.0, 30.0, 11000.0)}, ("row 3",)),
        ({"temperatures": (288.0, 287.8, 15.4, 217.4)}, ("row 3", "15.4", "kelvins", "288.55")),
        ({"temperatures": (288.0, 287.8)}, ("2 rows beside 4 heights",)),
        ({"relative_humidities": (0.5, 60.0, 0.5, 0.1)}, ("row 2", "0.6")),
        ({"kind": "us1976"}, ("goes with a table only",)),
        ({"kind": "file"}, ("heights",)),
        ({"heights": (), "temperatures": ()}, ("two rows",)),
    ],
)
def test_what_is_no_profile(changes: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises((InputError, ValueError)) as caught:
        ProfileSpec(**{**TABLE, **changes})
    for word in words:
        assert word in str(caught.value)


def test_what_cannot_be_built() -> None:
    with pytest.raises(InputError, match="above the top"):
        ProfileSpec(**TABLE, top=5000.0).build(Earth())
    with pytest.raises(InputError, match="outside the possible range"):
        build("standard").at(-1.0)
    with pytest.raises(InputError, match="0 K"):
        ProfileSpec(layers=(ExponentialLayer(excess=-400.0, height=10.0),)).build(Earth())
