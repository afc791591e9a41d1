"""Units at the door: texts such as "1.5 km" become SI, and the wrong kind of unit is refused."""

from __future__ import annotations

import math

import pytest

from nigemizu.units import UnitError, accepted_units, looks_like_quantity, to_unit


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("1.5 km", "m", 1500.0),
        ("27 cm", "m", 0.27),
        ("2mm", "m", 0.002),
        ("550 nm", "m", 550e-9),
        ("3", "m", 3.0),
        ("-4.5e1 m", "m", -45.0),
        ("30 degC", "K", 303.15),
        ("27 C", "K", 300.15),
        ("-40 °C", "K", 233.15),
        ("-40 degF", "K", 233.15),
        ("30 degC", "K difference", 30.0),
        ("18 degF", "K difference", 10.0),
        ("90 min", "s", 5400.0),
        ("2 h", "s", 7200.0),
        ("1013.25 hPa", "Pa", 101325.0),
        ("30 arcmin", "degree", 0.5),
        ("180 deg", "rad", math.pi),
        ("36 km/h", "m/s", 10.0),
        ("45 %", "1", 0.45),
        ("420 ppm", "1", 420e-6),
    ],
)
def test_converts(text: str, unit: str, expected: float) -> None:
    assert to_unit(text, unit) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(("text", "unit"), [("3 degC", "m"), ("5 km", "K"), ("1 furlong", "m"), ("x", "m")])
def test_refuses_and_lists_what_is_accepted(text: str, unit: str) -> None:
    with pytest.raises(UnitError) as caught:
        to_unit(text, unit)
    assert all(name in str(caught.value) for name in accepted_units(unit))


@pytest.mark.parametrize("text", ["300 + 20*exp(-z/0.1)", "3*z", "z", "molecular", "2 + 3", "300 - z", ""])
def test_formulas_and_words_are_no_quantities(text: str) -> None:
    assert not looks_like_quantity(text)


@pytest.mark.parametrize("text", ["2 km", "5%", "3.", ".5 m", "1e3 W/m2", "1 furlong"])
def test_numbers_with_one_word_are_quantities(text: str) -> None:
    assert looks_like_quantity(text)
