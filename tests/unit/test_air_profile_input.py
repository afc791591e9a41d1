"""What is no column of air is refused in one line that names the row and the number."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from nigemizu import InputError
from nigemizu.air import Earth, ExponentialLayer, Profile, ProfileSpec, standard_atmosphere

NAN = math.nan
HEIGHTS = (0.0, 100.0, 1000.0)
TABLE: dict[str, Any] = {"kind": "table", "heights": HEIGHTS, "temperatures": (288.0, 287.0, 281.0)}
PRESSURES = (101_325.0, 100_129.0, 89_876.0)
ROAD = {"ground_temperature": 300.0, "air_temperature": 288.0, "wind": 3.0}


def build(**changes: Any) -> Profile:
    return ProfileSpec(**{**TABLE, **changes}).build(Earth())


def measured(**changes: Any) -> SimpleNamespace:
    columns: dict[str, Any] = {
        "height": HEIGHTS,
        "temperature": (288.0, 287.0, 281.0),
        "pressure": PRESSURES,
        "vapour_fraction": (0.01, 0.009, 0.004),
    }
    return SimpleNamespace(**{name: np.array(rows, float) for name, rows in {**columns, **changes}.items()})


def build_measured(**changes: Any) -> Profile:
    return ProfileSpec(kind="file", file="sonde.csv").build(Earth(), measured(**changes))


BAD_ROWS = [
    # column of a table, of what was measured, row, number, words
    ("heights", "height", 3, 100.0, ("above row 2",)),
    ("heights", "height", 3, 40.0, ("above row 2", "metres above 100")),
    ("heights", "height", 2, NAN, ("no number", "leave the whole row out")),
    ("heights", "height", 3, 2e6, ("where no air is",)),
    ("temperatures", "temperature", 2, NAN, ("no number",)),
    ("temperatures", "temperature", 2, 13.85, ("the other rows are kelvins", "287 K", "°C")),
    ("temperatures", "temperature", 3, 2810.0, ("no temperature of air",)),
    ("pressures", "pressure", 2, 1001.29, ("hectopascals", "other rows are not", "100129 Pa")),
    ("pressures", "pressure", 1, 1013.25, ("hectopascals", "other rows are not", "101325 Pa")),
    ("pressures", "pressure", 2, 101_400.0, ("no less pressure than row 1",)),
    ("pressures", "pressure", 3, 100_129.0, ("no less pressure than row 2",)),
    ("pressures", "pressure", 3, NAN, ("no number",)),
    ("pressures", "pressure", 1, 101.325, ("no pressure of air at 0 m",)),
    ("pressures", "pressure", 2, -5.0, ("no pressure of air at 100 m",)),
    ("relative_humidities", "vapour_fraction", 2, 60.0, ("per cent", "0.6")),
    ("relative_humidities", "vapour_fraction", 3, -0.1, ("from 0 to 1",)),
    ("relative_humidities", "vapour_fraction", 1, NAN, ("no number",)),
]
GOOD = {"pressures": PRESSURES, "relative_humidities": (0.6, 0.5, 0.4)}


def test_the_good_rows_are_taken() -> None:
    """Without which none of what follows would mean anything."""
    assert build(**GOOD).pressure[0] == 101_325.0
    assert build_measured().vapour_fraction[0] == pytest.approx(0.01, rel=1e-12)


@pytest.mark.parametrize(("column", "name", "row", "number", "words"), BAD_ROWS)
def test_a_bad_row(column: str, name: str, row: int, number: float, words: tuple[str, ...]) -> None:
    rows = list({**TABLE, **GOOD}[column])
    rows[row - 1] = number
    with pytest.raises(InputError) as of_table:
        build(**{**GOOD, column: rows})
    rows = getattr(measured(), name).tolist()
    rows[row - 1] = number
    with pytest.raises(InputError) as of_file:
        build_measured(**{name: rows})
    assert of_table.value.key == f"profile.{column}"
    assert of_file.value.key == name
    for error in (of_table.value, of_file.value):
        text = str(error)
        assert f"row {row}" in text
        assert "\n" not in text
        assert error.value == number or math.isnan(number)
        assert f"got {number!r}" in text
        for word in words:
            assert word in text
    assert str(of_file.value).startswith("sonde.csv: ")


def test_whole_columns_in_other_units() -> None:
    with pytest.raises(InputError, match=r"row 1 is no temperature.*288\.15 K") as caught:
        build(temperatures=(15.0, 14.0, 8.0))
    assert "kelvins;" not in str(caught.value).replace("expected", "")
    with pytest.raises(InputError, match="row 1 is in hectopascals") as caught:
        build(pressures=(1013.25, 1001.29, 898.76))
    assert "other rows" not in str(caught.value)


def test_columns_of_other_lengths() -> None:
    for column in ("temperatures", "pressures", "relative_humidities"):
        with pytest.raises(InputError, match="1 rows beside 3 heights"):
            build(**{column: (0.5,)})
    with pytest.raises(InputError, match="two rows"):
        build(heights=(0.0,), temperatures=(288.0,))
    with pytest.raises(InputError, match="two rows"):
        build_measured(**dict.fromkeys(vars(measured()), ()))


def test_pressures_of_thin_air_are_no_hectopascals() -> None:
    """Cold air above high ground has a third of the standard's pressure at 33 km."""
    profile = build_measured(
        height=(0.0, 15e3, 30e3),
        temperature=(220.0, 190.0, 190.0),
        pressure=(68_000.0, 5_700.0, 400.0),
        vapour_fraction=(0.0, 0.0, 0.0),
    )
    assert profile.pressure[0] == 68_000.0
    assert profile.notes[-1].startswith("pressures given differ by up to ")
    assert float(standard_atmosphere(30e3)[1]) / 400.0 > 2.9


def test_pressures_have_to_be_those_of_air_at_rest() -> None:
    with pytest.raises(
        InputError, match=r"row 3 is not what the weight of the air makes it, 898\d\d"
    ) as caught:
        build(pressures=(101_325.0, 100_129.0, 80_000.0))
    assert caught.value.value == 80_000.0
    note = build(pressures=(101_325.0, 100_129.0, 89_000.0)).notes[-1]
    assert "0.95%" in note


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"kind": "us1976"}, "heights"),
        ({"kind": "us1976", "heights": (), "temperatures": (), "pressures": PRESSURES}, "pressures"),
        ({"kind": "isa", "heights": (), "temperatures": (), "smoothing": 4.0}, "smoothing"),
        ({"kind": "isa", "heights": (), "temperatures": (), "beyond": "isothermal"}, "beyond"),
        ({"relative_humidity": 0.5}, "relative_humidity"),
        ({"surface_temperature": 290.0}, "surface_temperature"),
        ({"pressures": PRESSURES, "surface_pressure": 1e5}, "surface_pressure"),
        ({"file": "sonde.csv"}, "file"),
        ({"kind": "file", "heights": (), "temperatures": ()}, "file"),
    ],
)
def test_nothing_is_given_in_vain(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError) as caught:
        build(**changes)
    assert caught.value.key == f"profile.{key}"


def test_data_that_end_too_low() -> None:
    spec = ProfileSpec(**TABLE)
    assert spec.build(Earth(), target=1000.0).measured_top == 1000.0
    with pytest.raises(InputError, match=r"end at 1000 m, below the target \(got 1200"):
        spec.build(Earth(), target=1200.0)
    ProfileSpec().build(Earth(), target=1200.0)
    with pytest.raises(InputError, match="not been read"):
        ProfileSpec(kind="file", file="sonde.csv").build(Earth())
    with pytest.raises(InputError, match="no use for what was measured"):
        ProfileSpec().build(Earth(), measured())


def test_a_surface_layer_needs_its_ground() -> None:
    for lowest, words in ((70.0, "do not reach"), (-5.0, "begin below")):
        with pytest.raises(InputError, match=words):
            build(heights=(lowest, 100.0, 1000.0), surface_layer=ROAD)
    lower = tuple(0.98 * pressure for pressure in PRESSURES)
    profile = build(heights=(5.0, 100.0, 1000.0), pressures=lower, surface_layer=ROAD)
    assert profile.base == 0.0
    temperature, pressure, _ = profile.at([0.0, 2.0, 5.0])
    # The line from 300 K holds θ, of which T falls short by the adiabat's 0.02 K over 2 m.
    assert temperature[0] == pytest.approx(300.0, abs=0.03)
    assert temperature[1] == pytest.approx(288.0, abs=1e-9)
    assert pressure[2] == pytest.approx(lower[0], rel=1e-9)


def test_temperatures_that_no_air_has() -> None:
    with pytest.raises(InputError, match="0 K or less at 0 m"):
        build(layers=(ExponentialLayer(excess=-400.0, height=10.0),))
    with pytest.raises(InputError, match="more than 3000 K at -5 m"):
        build(heights=(-5.0, 100.0, 1000.0), layers=(ExponentialLayer(excess=8.0, height=0.2),))


def test_nodes_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    profile = build(**GOOD)
    few = len(profile.nodes())
    monkeypatch.setattr("nigemizu.air.profile._MOST_NODES", few)
    assert len(profile.nodes()) == few
    with pytest.raises(InputError, match=f"more than {few} nodes") as caught:
        profile.nodes(1e-15)
    assert caught.value.value == 1e-15
    for tolerance in (0.0, -1e-12, NAN):
        with pytest.raises(InputError, match="tolerance"):
            profile.nodes(tolerance)
