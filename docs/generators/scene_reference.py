"""The reference of scene files, from the values that a scene is made of."""

from __future__ import annotations

import json
import types
import typing
from pathlib import Path
from typing import Any, Literal

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from generators.text import escaped, heading, table, write_if_changed
from nigemizu.scene import Scene
from nigemizu.scene.descriptions import described_fields, summary
from nigemizu.values import Value, field_unit

__all__ = ["write"]


def write(path: Path) -> None:
    meanings = described_fields(Scene)
    text = heading("Top level", "-")
    plain = {key: field for key, field in Scene.model_fields.items() if not _values(field.annotation)}
    text += _table(Scene, plain)
    described: set[type[Value]] = set()
    for key, field in Scene.model_fields.items():
        values = _values(field.annotation)
        if not values:
            continue
        many = _is_many(field.annotation)
        text += heading(f"[[{key}]]" if many else f"[{key}]", "-")
        if meanings.get(key):
            text += f"{escaped(meanings[key])}\n\n"
        text += _sections(values, described)
    write_if_changed(path, text)


def _sections(values: list[type[Value]], described: set[type[Value]]) -> str:
    """A section per value and, after it, per value inside it that no section has described yet."""
    text = ""
    for value in values:
        if value in described:
            continue
        described.add(value)
        text += (
            heading(_title(value), "~") + f"{escaped(summary(value))}\n\n" + _table(value, value.model_fields)
        )
        inner = [found for field in value.model_fields.values() for found in _values(field.annotation)]
        text += _sections(inner, described)
    return text


def _title(value: type[Value]) -> str:
    kind = value.model_fields.get("kind")
    choices = typing.get_args(kind.annotation) if kind is not None else ()
    return f'{value.__name__} (kind = "{choices[0]}")' if len(choices) == 1 else value.__name__


def _table(value: type[Value], fields: typing.Mapping[str, FieldInfo]) -> str:
    meanings = described_fields(value)
    rows = [
        (
            f"``{key}``",
            _type(field.annotation),
            _default(field),
            field_unit(field) or "",
            escaped(escaped(meanings.get(key, ""))),
        )
        for key, field in fields.items()
    ]
    return table(("key", "type", "default", "unit", "meaning"), rows, (18, 22, 14, 8, 38)) if rows else ""


def _default(field: FieldInfo) -> str:
    if field.default is PydanticUndefined:
        return "required" if field.default_factory is None else ""
    if field.default is None:
        return ""
    if isinstance(field.default, Value):
        return "its defaults"
    # As it is written in TOML: texts in double quotes, lists in brackets, true and false.
    return f"``{json.dumps(field.default, ensure_ascii=False)}``"


def _type(annotation: Any) -> str:
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return _type(arguments[0])
    if origin is Literal:
        return ", ".join(f'``"{choice}"``' for choice in arguments)
    if origin in (typing.Union, types.UnionType):
        parts = [_type(part) for part in arguments if part is not type(None)]
        return " or ".join(dict.fromkeys(parts))
    if origin is tuple:
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return f"list of {_type(arguments[0])}"
        return f"[{', '.join(_type(part) for part in arguments)}]"
    names = {float: "number", int: "whole number", str: "text", bool: "true or false", Path: "path"}
    return names.get(annotation, getattr(annotation, "__name__", str(annotation)))


def _is_many(annotation: Any) -> bool:
    return typing.get_origin(annotation) is tuple


def _values(annotation: Any) -> list[type[Value]]:
    """The values that `annotation` may hold."""
    if isinstance(annotation, type) and issubclass(annotation, Value):
        return [annotation]
    return [found for part in typing.get_args(annotation) for found in _values(part)]
