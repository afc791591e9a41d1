"""Every number of a scene says its unit, or is known to have none."""

from __future__ import annotations

import typing
from typing import Any

import pytest

from nigemizu.air import Atmosphere
from nigemizu.scene import Scene, builtin_scenes
from nigemizu.trace import Tracer
from nigemizu.units import accepted_units
from nigemizu.values import Value, field_unit

COLOURS = {
    "Aircraft.colour",
    "Aircraft.fin_colour",
    "Asphalt.colour",
    "Checker.colours",
    "Colour.colour",
    "Dots.colours",
    "Hills.colour",
    "Light.horizon_colour",
    "Light.zenith_colour",
    "Masonry.colour",
    "Pole.colours",
    "Road.line_colour",
    "Sand.colour",
    "Vehicle.colour",
}
SHARES = {
    "Asphalt.contrast",
    "Camera.exposure",  # doublings
    "Camera.f_number",
    "Convection.closure_constant",
    "Convection.courant",
    "Convection.turbulent_prandtl",
    "Diffusivity.horizontal_factor",
    "Dots.density",
    "Light.ground_albedo",
    "Light.sky_scale",
    "Light.sun_scale",
    "Light.turbidity",
    "Masonry.contrast",
    "Sand.contrast",
    "Texture.repeat",
    "Tracer.accuracy",  # in pixels or radians, as Tracer.accuracy_unit says
    "Tracer.chord_tolerance",  # of a pixel
    "Turbulence.exponent",
    "Turbulence.outer_scale_per_height",
    "Wind.exponent",
    "Water.colour",
}
OF_THE_QUANTITY = {
    "Daily.amplitude",
    "Daily.mean",
    "Disc.offset",
    "Disc.value",
    "Image.offsets",
    "Image.values",
    "Quantity.value",
    "Rectangle.offset",
    "Rectangle.value",
    "Schedule.values",
    "Stripes.offsets",
    "StructureTable.values",
    "Stripes.values",
}
"""Numbers in the unit of the field that holds the quantity."""


def _parts(annotation: Any) -> typing.Iterator[Any]:
    yield annotation
    if typing.get_origin(annotation) is not typing.Literal:
        for part in typing.get_args(annotation):
            yield from _parts(part)


def _values(annotation: Any, found: set[type[Value]]) -> set[type[Value]]:
    """Every value that an annotation can hold, all the way down."""
    for part in _parts(annotation):
        if isinstance(part, type) and issubclass(part, Value) and part not in found:
            found.add(part)
            for field in part.model_fields.values():
                _values(field.annotation, found)
    return found


def _numbers_without_unit() -> set[str]:
    return {
        f"{value.__name__}.{name}"
        for value in _values(Scene, set())
        for name, field in value.model_fields.items()
        if float in _parts(field.annotation) and field_unit(field) is None
    }


def test_every_number_has_a_unit_or_needs_none() -> None:
    assert _numbers_without_unit() == COLOURS | SHARES | OF_THE_QUANTITY


def test_quantities_say_their_unit_where_they_stand() -> None:
    wrong = [
        f"{value.__name__}.{name}"
        for value in _values(Scene, set())
        for name, field in value.model_fields.items()
        if "Quantity" in (getattr(part, "__name__", "") for part in _parts(field.annotation))
        and field_unit(field) is None
    ]
    assert wrong == []


@pytest.mark.parametrize(
    ("value", "key", "given", "expected"),
    [
        (Atmosphere, "surface_pressure", "1013 hPa", 101300.0),
        (Atmosphere, "relative_humidity", "40 %", 0.4),
        (Atmosphere, "humidity_temperature", "27 degC", 300.15),
        (Atmosphere, "co2_fraction", "420 ppm", 420e-6),
        (Atmosphere, "wavelength", "550 nm", 550e-9),
        (Tracer, "step", "50 cm", 0.5),
        (Tracer, "waviness_amplitude", "2 mm", 0.002),
        (Tracer, "waviness_length", "1 km", 1000.0),
    ],
)
def test_air_and_tracer_take_units(value: type[Value], key: str, given: str, expected: float) -> None:
    assert getattr(value.model_validate({key: given}), key) == pytest.approx(expected, rel=1e-12)


def test_a_constant_of_gladstone_and_dale_has_its_unit() -> None:
    air = Atmosphere.model_validate({"model": "gladstone-dale", "gladstone_dale_constant": "0.226 cm3/g"})
    assert air.gladstone_dale_constant == pytest.approx(2.26e-4)


def test_units_are_shown() -> None:
    text = Scene.load("pyramid").to_toml(comments=True)
    shown = {line.split(" = ")[0]: line.split("# [")[1].split("]")[0] for line in text.splitlines()
             if "# [" in line and " = " in line}  # fmt: skip
    assert shown["surface_pressure"] == "Pa"
    assert shown["wavelength"] == "m"
    assert shown["relative_humidity"] == "1"
    assert shown["waviness_length"] == "m"


def test_descriptions_are_words_not_markup() -> None:
    texts = [Scene.load(name).to_toml(comments=True) for name in builtin_scenes()]
    remarks = [line.split("  # ")[1] for text in texts for line in text.splitlines() if "  # " in line]
    assert len(remarks) > 100
    assert [remark for remark in remarks if any(mark in remark for mark in ("\\", ":math:", "``", "$"))] == []


def test_units_are_known() -> None:
    """A unit that the table lacks would take no text but its own name."""
    units = {
        unit
        for value in _values(Scene, set())
        for field in value.model_fields.values()
        if (unit := field_unit(field)) is not None
    }
    alone = {unit for unit in units if len(accepted_units(unit)) == 1}
    assert alone == {"DU", "degree/s", "J/kg/K", "K/m", "K2 m-2/3", "W/m2/K", "kg/m3", "m-2/3", "m/s2"}
