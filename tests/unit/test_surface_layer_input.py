"""What a surface layer refuses, and with which words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from nigemizu import InputError
from nigemizu.air import SurfaceLayer, similarity
from nigemizu.values import field_unit

WIND = {"air_temperature": 305.0, "ground_temperature": 330.0, "wind": 3.0}
FLUX = {"air_temperature": 305.0, "heat_flux": 200.0, "friction_velocity": 0.2}


@pytest.mark.parametrize(
    "given",
    [
        {"air_temperature": 305.0},
        {"air_temperature": 305.0, "wind": 3.0},
        {"air_temperature": 305.0, "ground_temperature": 330.0},
        {"air_temperature": 305.0, "heat_flux": 200.0},
        {"air_temperature": 305.0, "friction_velocity": 0.2},
        {"air_temperature": 305.0, "ground_temperature": 330.0, "friction_velocity": 0.2},
        {"air_temperature": 305.0, "wind": 3.0, "heat_flux": 200.0},
        {**WIND, **FLUX},
        {**WIND, "heat_flux": 200.0},
    ],
)
def test_exactly_one_way(given: dict[str, float]) -> None:
    with pytest.raises(
        InputError, match="either ground_temperature and wind, or heat_flux and fric"
    ) as caught:
        SurfaceLayer(**given)
    for key in set(given) - {"air_temperature"}:
        assert key in caught.value.problem


def test_both_ways_are_taken() -> None:
    assert SurfaceLayer(**WIND).fluxes.heat_flux > 0.0
    assert SurfaceLayer(**FLUX).fluxes.heat_flux == 200.0
    assert SurfaceLayer(**{**FLUX, "heat_flux": 0.0}).fluxes.obukhov_length == float("inf")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("wind", 0.0),
        ("wind", -1.0),
        ("air_temperature", 30.0),
        ("air_height", 0.0),
        ("roughness", 0.0),
        ("heat_roughness", -1e-4),
        ("wind", float("nan")),
        ("ruoghness", 1e-3),
    ],
)
def test_impossible_numbers(key: str, value: float) -> None:
    with pytest.raises(ValidationError, match=key):
        SurfaceLayer(**{**WIND, key: value})


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"wind_height": 1e-4}, "wind_height"),
        ({"air_height": 1e-5}, "air_height"),
        ({"blending_height": 1.0}, "blending_height"),
        ({"heat_roughness": 1.9}, "air_height"),
    ],
)
def test_heights_in_the_wrong_order(change: dict[str, float], key: str) -> None:
    with pytest.raises(InputError) as caught:
        SurfaceLayer(**{**WIND, **change})
    assert caught.value.key == key


def test_too_stable_names_the_remedy() -> None:
    with pytest.raises(InputError, match=r"bulk Richardson number .*more wind"):
        SurfaceLayer(air_temperature=300.0, ground_temperature=275.0, wind=1.0)
    with pytest.raises(InputError, match=r"z/L is .*friction_velocity"):
        SurfaceLayer(air_temperature=300.0, heat_flux=-50.0, friction_velocity=0.03)


def test_fluxes_that_no_ground_survives() -> None:
    with pytest.raises(InputError, match="leaves the ground between 100 and 2000 K") as caught:
        SurfaceLayer(air_temperature=300.0, heat_flux=1e5, friction_velocity=0.05)
    assert caught.value.key == "heat_flux, friction_velocity"


@pytest.mark.parametrize("height", [-1e-9, float("nan"), [0.0, float("inf")], "high"])
def test_heights_below_ground(height: Any) -> None:
    layer = SurfaceLayer(**WIND, blending_height=20.0)
    for method in (layer.temperature, layer.departure):
        with pytest.raises(InputError) as caught:
            method(height)
        assert caught.value.key == "height"


def test_departure_needs_a_blending_height() -> None:
    with pytest.raises(InputError) as caught:
        SurfaceLayer(**WIND).departure(1.0)
    assert caught.value.key == "blending_height"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("wind", 0.0),
        ("roughness", 0.0),
        ("heat_roughness", -1.0),
        ("air_temperature", 0.0),
        ("pressure", 0.0),
        ("wind_height", 1e-5),
        ("air_height", 1e-6),
        ("temperature_difference", float("nan")),
    ],
)
def test_solve_checks_its_numbers(key: str, value: float) -> None:
    given = {"temperature_difference": -25.0, "air_temperature": 305.0, "wind": 3.0, key: value}
    with pytest.raises(InputError) as caught:
        similarity.solve(**given)
    assert caught.value.key == key


def test_every_field_has_a_unit_and_takes_quantities() -> None:
    assert all(field_unit(field) for field in SurfaceLayer.model_fields.values())
    words = SurfaceLayer.model_validate(
        {
            "air_temperature": "31.85 degC",
            "ground_temperature": "330 K",
            "wind": "10.8 km/h",
            "roughness": "2 mm",
        }
    )
    numbers = SurfaceLayer(**WIND, roughness=2e-3)
    z = np.array([0.0, 0.01, 1.0])
    np.testing.assert_allclose(words.temperature(z), numbers.temperature(z), rtol=1e-12)


def test_shape_is_kept_and_the_value_goes_there_and_back() -> None:
    layer = SurfaceLayer(**WIND)
    assert layer.temperature(1.0).shape == ()
    assert layer.temperature(np.zeros((2, 3))).shape == (2, 3)
    assert layer.temperature([]).shape == (0,)
    assert SurfaceLayer.model_validate(layer.model_dump()) == layer
