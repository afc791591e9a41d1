"""What the refraction integral refuses, and the shapes that it returns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from nigemizu import trace
from nigemizu.air.hohenkerk_sinclair import HohenkerkSinclair
from nigemizu.errors import InputError

FloatArray = NDArray[np.float64]

R = 6371e3


def exponential(height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """n = 1 + 2.9e-4 exp(−h/8 km)."""
    excess = 2.9e-4 * np.exp(-height / 8000.0)
    return excess, -excess / 8000.0


def falling(excess: Any, slope: Any) -> Any:
    """The exponential air with n − 1 and dn/dh changed."""
    return lambda height: (excess(height, *exponential(height)), slope(height, *exponential(height)))


def same_slope(_height: FloatArray, _excess: FloatArray, slope: FloatArray) -> FloatArray:
    """As it is."""
    return slope


def same_index(_height: FloatArray, excess: FloatArray, _slope: FloatArray) -> FloatArray:
    """As it is."""
    return excess


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"apparent_elevation": 45.0}, ["apparent_elevation", "45.0", "radians from -pi/2 to pi/2"]),
        ({"apparent_elevation": -1.6}, ["apparent_elevation", "radians"]),
        ({"apparent_elevation": [0.0, np.nan]}, ["apparent_elevation", "not a finite number"]),
        ({"apparent_elevation": "low"}, ["apparent_elevation", "not a number", "'low'"]),
        ({"radius": 0.0}, ["radius", "6371e3"]),
        ({"radius": [R, R]}, ["radius", "6371e3"]),
        ({"top": None}, ["top", "where the air ends", "86e3"]),
        ({"top": -1.0}, ["top", "above the ground at 0"]),
        ({"observer_height": -1.0}, ["observer_height", "not in the air", "-1.0"]),
        ({"observer_height": 100e3}, ["observer_height", "not in the air"]),
        ({"ground": -7e6}, ["ground", "centre"]),
        ({"breaks": [1.0, np.inf]}, ["breaks", "heights in metres"]),
        ({"tolerance": 0.0}, ["tolerance", "1e-15 to 0.01"]),
        ({"tolerance": 0.1}, ["tolerance", "1e-15 to 0.01"]),
        ({"index": lambda h: 0.0 * h}, ["index", "(n - 1, dn/dh)"]),
        ({"index": lambda h: (np.zeros((2, 3)), np.zeros((2, 3)))}, ["index", "(2, 3)", "per wavelength"]),
        (
            {"index": falling(lambda h, n, s: np.where(h > 5, np.nan, n), same_slope)},
            ["index", "no finite index"],
        ),
        ({"index": falling(lambda h, n, s: n - 2.0, same_slope)}, ["index", "no finite index above 0"]),
    ],
)
def test_refuses(arguments: dict[str, Any], words: list[str]) -> None:
    given = {"index": exponential, "apparent_elevation": 0.1, "radius": R, "top": 90e3, **arguments}
    with pytest.raises(InputError) as raised:
        trace.astronomical_refraction(**given)
    message = str(raised.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("index", "words"),
    [
        (falling(same_index, lambda h, n, s: -s), ["dn/dh does not add up"]),  # the wrong sign
        (falling(same_index, lambda h, n, s: 1e3 * s), ["dn/dh does not add up", "metres"]),  # per kilometre
        (falling(same_index, lambda h, n, s: s * (1 + 1e-4)), ["dn/dh does not add up"]),
        (falling(same_index, lambda h, n, s: 0.0 * s), ["dn/dh does not add up"]),
        (
            falling(lambda h, n, s: n - 1e-8 * (h > 37.1), same_slope),
            ["dn/dh does not add up", "37.1", "continuous"],
        ),
    ],
)
def test_a_slope_that_is_not_the_derivative_is_refused(index: Any, words: list[str]) -> None:
    with pytest.raises(InputError) as raised:
        trace.astronomical_refraction(index, 0.0, radius=R, top=90e3)
    for word in words:
        assert word in str(raised.value)


def test_a_jump_at_a_break_is_refused() -> None:
    index = falling(lambda h, n, s: n - 1e-8 * (h > 37.0), same_slope)
    with pytest.raises(InputError, match="jumps at the height 37 m"):
        trace.astronomical_refraction(index, 0.0, radius=R, top=90e3, breaks=[37.0])
    tiny = falling(lambda h, n, s: n - 1e-12 * (h > 37.0), same_slope)
    assert np.isfinite(trace.astronomical_refraction(tiny, 0.0, radius=R, top=90e3, breaks=[37.0]))


def test_shapes() -> None:
    """Elevations keep their shape; wavelengths come last."""

    def coloured(height: FloatArray) -> tuple[FloatArray, FloatArray]:
        excess, slope = exponential(height)
        return np.array([1.0, 1.01, 1.02]) * excess, np.array([1.0, 1.01, 1.02]) * slope

    grid = np.linspace(-0.004, 1.5, 8).reshape(2, 4)
    one = trace.astronomical_refraction(exponential, grid, radius=R, top=90e3, observer_height=100.0)
    three = trace.refracted_rays(coloured, grid, radius=R, top=90e3, observer_height=100.0)
    assert one.shape == (2, 4)
    assert three.refraction.shape == three.status.shape == three.lowest.shape == (2, 4, 3)
    assert three.true_elevation.shape == three.path_length.shape == (2, 4, 3)
    np.testing.assert_allclose(three.refraction[..., 0], one, rtol=1e-9, atol=0)
    assert np.all(np.diff(three.refraction, axis=-1) > 0)
    assert trace.astronomical_refraction(exponential, 0.1, radius=R, top=90e3).shape == ()
    assert trace.astronomical_refraction(coloured, 0.1, radius=R, top=90e3).shape == (3,)
    assert trace.astronomical_refraction(coloured, [], radius=R, top=90e3).shape == (0, 3)
    assert trace.horizon(coloured, [[0.0, 2.0]], radius=R).dip.shape == (1, 2, 3)
    assert trace.horizon(coloured, 2.0, radius=R).distance.shape == (3,)
    assert trace.horizon(coloured, [], radius=R).dip.shape == (0, 3)
    assert trace.refraction_coefficient(coloured, [0.0, 2.0], radius=R).shape == (2, 3)
    assert trace.refraction_coefficient(exponential, [0.0, 2.0], radius=R).shape == (2,)
    assert trace.column(lambda h: 1.0, coloured, grid, radius=R, top=90e3, observer_height=100.0).shape == (
        2,
        4,
        3,
    )


def test_many_rays_are_taken_in_pieces() -> None:
    """More rays than fit in one block give what each gives alone."""
    many = np.linspace(-0.005, np.pi / 2, 20_001)
    together = trace.astronomical_refraction(exponential, many, radius=R, top=90e3, observer_height=100.0)
    some = [0, 1, 37, 9_999, 10_000, 20_000]
    alone = [
        trace.astronomical_refraction(exponential, many[i], radius=R, top=90e3, observer_height=100.0)
        for i in some
    ]
    np.testing.assert_allclose(together[some], alone, rtol=0, atol=1e-9)
    up = together[many > 0.05]
    assert np.all(np.diff(up) < 0)


def test_breaks_that_all_but_coincide_count_as_one() -> None:
    crowd = [11e3, np.nextafter(11e3, 12e3), 11e3 + 1e-9, 2.0, np.nextafter(2.0, 3.0), 1e-12, -5.0, 95e3]
    plain, crowded = (
        trace.astronomical_refraction(
            exponential, [-1e-4, 0.0, 0.5], radius=R, top=90e3, observer_height=2.0, breaks=breaks
        )
        for breaks in ((), crowd)
    )
    np.testing.assert_allclose(plain, crowded, rtol=0, atol=1e-12)


def test_breaks_and_top_of_the_index_are_taken() -> None:
    air = HohenkerkSinclair(288.15, 101325.0)
    own = trace.astronomical_refraction(air, 0.2, radius=air.radius)
    given = trace.astronomical_refraction(air, 0.2, radius=air.radius, top=80e3, breaks=[11e3])
    lower = trace.astronomical_refraction(air, 0.2, radius=air.radius, top=20e3)
    assert own == given
    assert lower < 0.99 * own


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: trace.horizon(exponential, -1.0, radius=R), ["observer_height", "-1.0"]),
        (lambda: trace.horizon(exponential, 1.0, radius=R, tolerance=1.0), ["tolerance"]),
        (lambda: trace.horizon(exponential, 1.0, radius=-R), ["radius"]),
        (lambda: trace.horizon(exponential, 1.0, radius=R, ground=np.nan), ["ground"]),
        (lambda: trace.refraction_coefficient(exponential, np.nan, radius=R), ["height"]),
        (lambda: trace.refraction_coefficient(exponential, 0.0, radius=0.0), ["radius"]),
        (lambda: HohenkerkSinclair(15.0, 101325.0), ["temperature", "15.0", "kelvin"]),
        (lambda: HohenkerkSinclair(288.15, 0.0), ["pressure"]),
        (lambda: HohenkerkSinclair(288.15, 101325.0, relative_humidity=50.0), ["relative_humidity"]),
        (lambda: HohenkerkSinclair(288.15, 101325.0, wavelength=0.55), ["wavelength", "300e-9"]),
        (lambda: HohenkerkSinclair(288.15, 101325.0, observer_height=12e3), ["observer_height"]),
        (lambda: HohenkerkSinclair(288.15, 101325.0, latitude=50.0), ["latitude", "radians"]),
        (lambda: HohenkerkSinclair(288.15, 101325.0, lapse_rate=6.5), ["lapse_rate", "K/m"]),
    ],
)
def test_others_refuse(call: Any, words: list[str]) -> None:
    with pytest.raises(InputError) as raised:
        call()
    for word in words:
        assert word in str(raised.value)


def test_the_model_atmosphere() -> None:
    """Continuous at the tropopause, with the derivative of its index, for any number of wavelengths."""
    light = np.array([400e-9, 550e-9, 700e-9])
    air = HohenkerkSinclair(280.0, 90e3, relative_humidity=0.7, wavelength=light, observer_height=800.0)
    heights = np.array([0.0, 800.0, 5e3, 10.9e3, 11.1e3, 30e3])[:, None]
    excess, slope = air(heights)
    assert excess.shape == slope.shape == (6, 3)
    numeric = (air(heights + 1.0)[0] - air(heights - 1.0)[0]) / 2.0
    np.testing.assert_allclose(slope, numeric, rtol=1e-6, atol=0)
    below, above = (air(np.asarray(11e3 + step))[0] for step in (-1e-6, 1e-6))
    np.testing.assert_allclose(below, above, rtol=1e-8, atol=0)
    # at the observer n − 1 is the formula's at 280 K and 900 mbar, less the vapour's share
    dry = HohenkerkSinclair(280.0, 90e3, wavelength=light, observer_height=800.0)
    expected = 1e-6 * (287.6155 + 1.62887 / 0.55**2 + 0.01360 / 0.55**4) * 273.15 / 1013.25 * 900 / 280
    assert dry(np.asarray(800.0))[0][1] == pytest.approx(expected, rel=1e-12, abs=0)
    assert np.all(excess[1] < dry(np.asarray(800.0))[0])
