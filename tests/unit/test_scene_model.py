"""The scene: one model that is TOML, Python and command line at once."""

from __future__ import annotations

import types
import typing
from pathlib import Path
from typing import Any

import pytest

from nigemizu import InputError
from nigemizu.scene import Scene, builtin_scenes
from nigemizu.scene.times import TimeSpec
from nigemizu.values import Value, field_unit

NAMES = (
    *("fata-morgana", "lake", "looming", "moonrise", "plume", "pyramid", "road", "runway", "shimmer"),
    *("sunset-inferior", "sunset-mock"),
)


def _values(annotation: Any, found: set[type[Value]]) -> set[type[Value]]:
    """Every value that an annotation can hold, all the way down."""
    if isinstance(annotation, type) and issubclass(annotation, Value) and annotation not in found:
        found.add(annotation)
        for hint in typing.get_type_hints(annotation, include_extras=True).values():
            _values(hint, found)
    for part in typing.get_args(annotation):
        _values(part, found)
    return found


def _nullable(annotation: Any) -> bool:
    origin = typing.get_origin(annotation)
    return origin in (types.UnionType, typing.Union) and type(None) in typing.get_args(annotation)


def test_the_built_in_scenes_are_there_and_valid() -> None:
    assert tuple(builtin_scenes()) == NAMES
    for name in NAMES:
        Scene.load(name).check()


@pytest.mark.parametrize("comments", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_toml_reads_back_into_an_equal_scene(name: str, comments: bool) -> None:
    scene = Scene.load(name)
    assert Scene.from_toml(scene.to_toml(comments=comments)) == scene
    assert Scene.from_toml(scene.to_toml()).to_toml() == scene.to_toml()


def test_awkward_values_survive_the_round_trip() -> None:
    scene = Scene.load(
        "pyramid",
        {
            "title": 'quote " backslash \\ tab \t newline \n delete \x7f ünï',
            "ground": {
                "kind": "exchange",
                "coefficient": 1e-300,
                "temperature": {
                    "daily": {"mean": 300.1, "amplitude": 0.1 + 0.2},
                    "patterns": [
                        {"kind": "stripes", "width": 2.0, "offsets": [0.0, -5.0]},
                        {
                            "kind": "patches",
                            "patches": [{"center": [0, 0], "radius": 1, "shape": "disc", "offset": 3}],
                        },
                    ],
                },
            },
            "objects": [
                {"kind": "mitsuba", "fragment": {"type": "sphere", "a-b": {"x.y": [1, 2.5, True, "z"]}}},
            ],
        },
    )
    assert Scene.from_toml(scene.to_toml(comments=True)) == scene


def test_what_can_be_left_out_is_left_out_by_default() -> None:
    """TOML cannot say "nothing": a key that may be None must be None when it is not there."""
    wrong = [
        f"{value.__name__}.{name}"
        for value in _values(Scene, set())
        for name, field in value.model_fields.items()
        if _nullable(field.annotation) and (field.is_required() or field.get_default() is not None)
    ]
    assert wrong == []


def test_units_and_paths_are_converted_at_the_door(tmp_path: Path) -> None:
    text = Scene.load("pyramid").to_toml()
    changes = {
        "camera.eye": ["-0.01 km", "50 cm", "1800 mm"],
        "camera.pitch": "30 arcmin",
        "ground.temperature": "55 degC",
        "initial.unevenness.0.amplitude": "0.1 degC",
        "time.duration": "5 min",
        "objects.1.material": {"kind": "texture", "image": "brick.png"},
    }
    scene = Scene.from_toml(text, folder=tmp_path, overrides=changes)
    assert scene.camera.eye == pytest.approx((-10.0, 0.5, 1.8))
    assert scene.camera.pitch == pytest.approx(0.5)
    assert scene.ground.temperature.value == pytest.approx(328.15)
    assert scene.initial.unevenness[0].amplitude == pytest.approx(0.1)  # a difference has no offset
    assert scene.time.duration == 300.0
    assert scene.objects[1].material.image == tmp_path / "brick.png"


def test_changes_are_validated() -> None:
    scene = Scene.load("pyramid")
    assert scene.with_changes({"camera.samples": 3}).camera.samples == 3
    assert scene.camera.samples != 3
    with pytest.raises(InputError, match=r"camera\.samples"):
        scene.with_changes({"camera.samples": 0})


def test_schema_names_every_key_and_accepts_units() -> None:
    schema = Scene.json_schema()
    assert set(schema["properties"]) == set(Scene.model_fields)
    duration = schema["$defs"]["TimeSpec"]["properties"]["duration"]
    assert {part["type"] for part in duration["anyOf"]} == {"number", "string"}
    undocumented = [
        f"{name}.{key}"
        for name, definition in schema["$defs"].items()
        for key, entry in definition.get("properties", {}).items()
        if "description" not in entry
    ]
    assert undocumented == []


def test_schema_knows_places_by_bearing_and_units_inside_arrays() -> None:
    schema = Scene.json_schema()
    position = schema["$defs"]["Pole"]["properties"]["position"]
    coordinates, place = position["anyOf"]
    assert place == {"$ref": "#/$defs/Place"}
    assert [{part["type"] for part in axis["anyOf"]} for axis in coordinates["prefixItems"]] == [
        {"number", "string"}
    ] * 3
    assert set(schema["$defs"]["Place"]["properties"]) == {"distance", "bearing", "height"}
    assert schema["$defs"]["Place"]["required"] == ["distance"]
    # A point is no text, though each of its coordinates may be one.
    target = schema["$defs"]["Camera"]["properties"]["target"]
    assert [part["type"] for part in target["anyOf"]] == ["array", "null"]
    assert target["anyOf"][0]["prefixItems"][0]["anyOf"][1]["type"] == "string"


def test_lengths_and_temperatures_say_their_unit() -> None:
    for value, key, unit in (
        (TimeSpec, "picture", "s"),
        (type(Scene.load("pyramid").grid), "first_cell", "m"),
        (type(Scene.load("pyramid").camera), "target", "m"),
    ):
        assert field_unit(value.model_fields[key]) == unit


@pytest.mark.parametrize(
    ("duration", "every", "stored"),
    [
        (10.0, 4.0, (0.0, 4.0, 8.0, 10.0)),
        (10.0, 5.0, (0.0, 5.0, 10.0)),
        (0.3, 0.1, (0.0, 0.1, 0.2, 0.3)),
        (0.0, None, (0.0,)),
        (1.0, 7.0, (0.0, 1.0)),
    ],
)
def test_stored_instants_end_at_the_end(
    duration: float, every: float | None, stored: tuple[float, ...]
) -> None:
    assert TimeSpec(duration=duration, store_every=every).stored == pytest.approx(stored)


def test_more_instants_than_anyone_stores_are_refused_before_they_are_listed() -> None:
    with pytest.raises(InputError, match=r"time\.store_every: more than 1000000 instants"):
        _ = TimeSpec(duration=1e9, store_every=1.0).stored


def test_instants_larger_than_the_memory_are_refused_before_the_first() -> None:
    scene = Scene.load("pyramid", {"time.duration": 1e6, "time.store_every": 1.0})
    with pytest.raises(InputError, match=r"times: 1000001 instants need 6193\.2 GB.*save_air"):
        scene.simulate()
