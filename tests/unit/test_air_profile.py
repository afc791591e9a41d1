"""Profiles: smooth between their breaks, honest about their derivative, and what they refuse."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

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
    index, nodes = profile.index(Atmosphere()), profile.nodes(1e-12)
    width = np.diff(nodes) * (1 - 1e-6)
    wide = np.diff(nodes) > np.maximum(1e-4, 2e-6 * nodes[1:])
    begin, end = index(nodes[:-1]), index(nodes[:-1] + width)
    rise = end[0] - begin[0]
    first, last = begin[1] * width, end[1] * width
    for w in (0.13, 0.37, 0.61, 0.91):
        cubic = (first + w * (2 * (3 * rise - 2 * first - last) + w * 3 * (first + last - 2 * rise))) / width
        slope = index(nodes[:-1] + w * width)[1]
        # Vapour over ice gives way to vapour over water at 0 °C, with a bend that no break marks.
        thaws = np.abs(profile.at(nodes[:-1])[0] - 273.16) < (0.5 if profile.vapour_fraction.any() else 0.0)
        wrong = np.abs(cubic - slope) / (1e-12 + 1e-6 * np.abs(slope))
        assert wrong[wide & ~thaws].max() < 1.2
        assert wrong[wide].max() < 10.0
    assert 250 < len(nodes) < 1000
    assert len(profile.nodes(1e-14)) > len(nodes)
    assert np.all(np.diff(nodes) > 0)
    assert nodes[0] == 0.0
    assert np.isin(profile.breaks, nodes).all()


def test_nodes_of_n_serve_the_map_of_a_round_earth() -> None:
    """n′ = n e^(z/R) over z = R ln(1 + h/R), with dn′/dz = (dn/dh e^(z/R) + n/R) e^(z/R)."""
    earth, profile = Earth(), build("layers")
    index, heights = profile.index(Atmosphere()), profile.nodes()

    def mapped(z: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        stretch = earth.stretch(z)
        bare, slope = index(earth.height(z))
        more = earth.height(z) / earth.radius  # e^(z/R) − 1
        return bare * stretch + more, (slope * stretch + (1 + bare) / earth.radius) * stretch

    z = earth.conformal_height(heights)
    width = np.diff(z) * (1 - 1e-5)
    (low, first), (high, last) = mapped(z[:-1] + 1e-6 * width), mapped(z[:-1] + (1 + 1e-6) * width)
    rise, first, last = high - low, first * width, last * width
    wide = width > 0.05  # narrower ones lose digits to e^(z/R)
    for w in (0.2, 0.45, 0.8):
        cubic = (first + w * (2 * (3 * rise - 2 * first - last) + w * 3 * (first + last - 2 * rise))) / width
        slope = mapped(z[:-1] + (w + 1e-6) * width)[1]
        assert (np.abs(cubic - slope) / (1e-12 + 1e-6 * np.abs(slope)))[wide].max() < 2.0


@pytest.mark.parametrize("name", [*SPECS, "roundings that meet"])
def test_nodes_stay_apart_in_single_precision(name: str) -> None:
    """At 2.1 m two corners' roundings meet, but for the last bit; the volume refuses cells that thin."""
    heights = (0.0, 0.1, 4.1, 11000.0)
    meeting = ProfileSpec(kind="table", heights=heights, temperatures=TEMPERATURES, smoothing=4.0)
    assert 0.1 + 2.0 != 4.1 - 2.0
    profile = meeting.build(Earth()) if name not in SPECS else build(name)
    z = Earth().conformal_height(profile.nodes()).astype(np.float32)
    assert np.all(np.diff(z) > 0)


def test_long_soundings_take_as_many_nodes_as_levels() -> None:
    heights = np.linspace(0.0, 30e3, 3001)
    noise = np.random.default_rng(7).normal(0.0, 0.05, len(heights))
    temperatures = 288.15 - 6.5e-3 * np.minimum(heights, 11e3) + noise
    spec = ProfileSpec(kind="table", heights=tuple(heights), temperatures=tuple(temperatures))
    assert 3001 < len(spec.build(Earth()).nodes()) < 6000


def test_corners_are_rounded_over_their_width_and_no_farther() -> None:
    heights, values = np.array(HEIGHTS), np.array(TEMPERATURES)
    sharp, rounded = Linear(heights, values), Linear(heights, values, 4.0)
    away = np.array([5.0, 27.9, 32.1, 47.9, 52.1, 9000.0])
    np.testing.assert_allclose(rounded.value_and_slope(away), sharp.value_and_slope(away), rtol=1e-12)
    at = rounded.value_and_slope(np.array([30.0]))[0] - sharp.value_and_slope(np.array([30.0]))[0]
    # Half of the slopes' jump times w/2 times r(0) = 5/32.
    assert float(at[0]) == pytest.approx((0.8 / 20 + 0.2 / 30) * 2.0 * 5 / 32, rel=1e-12)


def test_corners_that_are_closer_than_their_rounding() -> None:
    """Against the convolution itself, with 15/16 (1 − u²)² over 6 m, by Gauss's rule between the corners."""
    heights = np.array([0.0, 10.0, 11.0, 13.0, 30.0])
    values = np.array([280.0, 290.0, 288.0, 288.5, 280.0])
    found = Linear(heights, values, 6.0)
    points, weights = np.polynomial.legendre.leggauss(8)
    for height in (8.2, 9.9, 11.0, 12.4, 14.9):
        stops = np.unique(np.clip([height - 3, *heights, height + 3], height - 3, height + 3))
        expected = 0.0
        for low, high in pairwise(stops):
            h = (low + high) / 2 + (high - low) / 2 * points
            kernel = 15 / 16 * (1 - ((h - height) / 3) ** 2) ** 2 / 3
            lines = Linear(heights, values).value_and_slope(h)[0]
            expected += float((high - low) / 2 * (weights * kernel * lines).sum())
        value, slope = found.value_and_slope(np.array([height]))
        assert value[0] == pytest.approx(expected, rel=1e-13)
        ends = found.value_and_slope(np.array([height - 1e-4, height + 1e-4]))[0]
        assert slope[0] == pytest.approx(np.diff(ends)[0] / 2e-4, abs=1e-6)


def test_lines_pass_through_their_points_and_go_on() -> None:
    heights, values = np.array(HEIGHTS), np.array(TEMPERATURES)
    lines = Linear(heights, values)
    np.testing.assert_allclose(lines.value_and_slope(heights)[0], values, rtol=1e-15)
    inside = np.linspace(0.0, 11e3, 777)
    np.testing.assert_allclose(
        lines.value_and_slope(inside)[0], np.interp(inside, heights, values), rtol=1e-14
    )
    assert lines.value_and_slope(np.array([30.0]))[1][0] == pytest.approx(0.04)  # of the line above
    assert lines.value_and_slope(np.array([-15.0]))[0][0] == pytest.approx(288.1)


@pytest.mark.parametrize(("smoothing", "joins"), [(None, True), (4.0, True), (0.0, False)])
def test_the_gradient_joins_above_the_data(smoothing: float | None, joins: bool) -> None:
    spec = ProfileSpec(
        kind="table", heights=(0.0, 50.0, 100.0), temperatures=(280.0, 281.0, 285.0), smoothing=smoothing
    )
    profile = spec.build(Earth())
    _, (below, above) = profile.course.value_and_slope(np.array([100.0 - 1e-7, 100.0 + 1e-7]))
    # The standard's −6.5 K/km, and −(285 − 287.5)/3 km.
    assert below == pytest.approx(0.08, rel=1e-6)
    assert above == pytest.approx(0.08 if joins else -6.5e-3 + 2.5 / 3e3, rel=1e-3)
    # A few of the lengths over which they join farther up the two are one.
    kinked = spec.model_copy(update={"smoothing": 0.0}).build(Earth())
    assert profile.at(900.0)[0] == pytest.approx(kinked.at(900.0)[0], abs=1e-4)
    assert (100.0 in profile.course.kinks) != joins


def test_a_long_last_interval_joins_within_some_hundred_metres() -> None:
    """B x exp(−x/ℓ) with ℓ = 200 m, B the jump of the slope from −26.055/4950 K/m without a joining."""
    spec = ProfileSpec(kind="table", heights=(0.0, 50.0, 5000.0), temperatures=(280.0, 281.0, 254.945))
    smooth = spec.build(Earth())
    kinked = spec.model_copy(update={"smoothing": 0.0}).build(Earth())
    x = np.array([200.0, 400.0, 3000.0])
    bend = smooth.at(5000.0 + x)[0] - kinked.at(5000.0 + x)[0]
    assert bend[1] / bend[0] == pytest.approx(2.0 * np.exp(-1.0), rel=1e-6)
    above = kinked.course.value_and_slope(np.array([5000.0]))[1][0]
    assert bend[0] == pytest.approx((-26.055 / 4950.0 - above) * 200.0 / np.e, rel=1e-6)
    assert abs(bend[2]) < 1e-4


def test_layers_are_what_their_numbers_say() -> None:
    heights = np.array([0.0, 30.0, 300.0])
    step = Inversion(jump=6.0, height=30.0, thickness=4.0)
    np.testing.assert_allclose(step.value_and_slope(heights)[0], [0.0, 3.0, 6.0], atol=1e-5)
    edges = np.array([28.0, 32.0])
    assert np.diff(step.value_and_slope(edges)[0])[0] == pytest.approx(6.0 * 0.7616, abs=1e-3)
    fading = Inversion(jump=6.0, height=30.0, thickness=4.0, decay=300.0)
    far = fading.value_and_slope(np.array([330.0, 630.0]))[0]
    assert far[1] / far[0] == pytest.approx(np.exp(-1), rel=1e-9)
    assert far[0] == pytest.approx(6.0 / np.e, rel=1e-2)
    skin = ExponentialLayer(excess=-8.0, height=0.2)
    np.testing.assert_allclose(skin.value_and_slope(np.array([0.0, 0.2]))[0], [-8.0, -8.0 / np.e])
    bump = GaussianLayer(excess=1.2, height=23.0, width=3.0)
    np.testing.assert_allclose(bump.value_and_slope(np.array([23.0, 26.0]))[0], [1.2, 1.2 / np.e])
    for layer in (step, fading, skin, bump):
        at = np.array([0.05, 22.0, 29.0, 31.0, 60.0])
        rise = layer.value_and_slope(at + 1e-5)[0] - layer.value_and_slope(at - 1e-5)[0]
        np.testing.assert_allclose(layer.value_and_slope(at)[1], rise / 2e-5, rtol=1e-6, atol=1e-9)


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
    assert profile.at(2.0)[0] == pytest.approx(274.15, abs=1e-9)
    # The standard falls by 6.5 K/km where the adiabat falls by 9.76; the shift by −14 K fades over 3 km.
    assert profile.at(0.0)[0] == pytest.approx(278.15 - 2.0 * (9.76e-3 - 6.5e-3) - 14.0 * 2 / 3e3, abs=1e-3)


def test_a_surface_layer_has_the_gradient_of_its_fluxes() -> None:
    """dθ/dz = φh θ*/(κ z) just above the sublayer, a straight line below; the standard adds millikelvins."""
    profile = build("surface layer")
    layer = ProfileSpec(**SPECS["surface layer"]).surface_layer
    assert layer is not None
    z = np.array([1e-3, 0.01, 0.1, 1.0])
    fluxes = layer.fluxes
    phi = (1 - 16 * z / fluxes.obukhov_length) ** -0.5
    expected = phi * fluxes.temperature_scale / (0.4 * z)
    np.testing.assert_allclose(profile.course.value_and_slope(z)[1], expected, rtol=1e-2, atol=2e-2)
    line = np.array([0.0, 0.5, 0.999]) * layer.sublayer_top
    slopes = profile.course.value_and_slope(line)[1]
    np.testing.assert_allclose(slopes, slopes[0], rtol=1e-9)
    ends = profile.course.value_and_slope(np.array([0.0, layer.sublayer_top]))[0]
    assert slopes[0] == pytest.approx((ends[1] - ends[0]) / layer.sublayer_top, rel=1e-6)


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
