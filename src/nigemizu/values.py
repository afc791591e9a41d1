"""The base of every value that a scene file can hold."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, ValidationInfo, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from nigemizu.units import UnitError, looks_like_quantity, to_unit

__all__ = ["Value", "field_unit", "holds_path", "nearest"]


class Value(BaseModel):
    """A frozen, validated value with named fields.

    Unknown fields are refused, numbers must be finite, and nothing can be changed after construction
    (make a changed copy with ``value.model_copy(update=...)``). Each room of the package defines its own
    values; `nigemizu.scene.Scene` is made of them, so that the TOML file, the Python API and the command
    line describe the same thing.

    Notes
    -----
    A field that says its unit, ``Field(json_schema_extra={"unit": "m"})``, also takes texts such as
    ``"1.5 km"`` (`nigemizu.units`); the unit ``"K difference"`` stands for a temperature difference. A field
    that is a `pathlib.Path` resolves relative paths against the folder of the file that is being read.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)

    @model_validator(mode="before")
    @classmethod
    def _open_the_door(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, Mapping):
            return data
        folder = (info.context or {}).get("folder")
        fields, converted = cls.model_fields, dict(data)
        for key, given in data.items():
            field = fields.get(key)
            if field is None:
                raise _unknown_key(key, tuple(fields))
            unit = field_unit(field)
            if unit is not None:
                converted[key] = _in_unit(key, given, unit)
            elif isinstance(given, bool) and not _may_be(field.annotation, bool):
                raise PydanticCustomError(
                    "wrong_type", "wrong type", {"key": key, "given": given, "expected": "a number or a text"}
                )
            elif folder is not None and isinstance(given, str | Path) and holds_path(field):
                converted[key] = Path(folder) / given
        return converted


def field_unit(field: FieldInfo) -> str | None:
    """The unit that a field declares, or None; it may stand inside, as in ``Annotated[float, …] | None``."""
    extra = field.json_schema_extra
    if isinstance(extra, dict) and isinstance(extra.get("unit"), str):
        return str(extra["unit"])
    return _unit_inside(field.annotation)


def _unit_inside(annotation: Any) -> str | None:
    for mark in getattr(annotation, "__metadata__", ()):
        if isinstance(mark, FieldInfo) and (unit := field_unit(mark)) is not None:
            return unit
    return next(filter(None, map(_unit_inside, get_args(annotation))), None)


def holds_path(field: FieldInfo) -> bool:
    """Whether a field names a file."""
    return _may_be(field.annotation, Path)


def nearest(word: str, valid: tuple[str, ...]) -> str:
    """A hint naming the entry of `valid` that is closest to `word`, or all of them when none is close."""
    close = difflib.get_close_matches(word, valid, n=1, cutoff=0.6)
    return f"did you mean {close[0]!r}?" if close else f"valid are {', '.join(valid)}"


def _may_be(annotation: Any, wanted: type) -> bool:
    return annotation is wanted or any(_may_be(part, wanted) for part in get_args(annotation))


def _unknown_key(key: object, valid: tuple[str, ...]) -> PydanticCustomError:
    return PydanticCustomError(
        "unknown_key", "unknown key", {"key": str(key), "remedy": nearest(str(key), valid)}
    )


def _in_unit(key: str, given: Any, unit: str) -> Any:
    if isinstance(given, list | tuple):
        return [_in_unit(key, one, unit) for one in given]
    if isinstance(given, bool):
        raise PydanticCustomError(
            "wrong_type", "wrong type", {"key": key, "given": given, "expected": f"a number [{unit}]"}
        )
    # Other texts (a formula, a word such as "molecular") are the field's own business.
    if isinstance(given, str) and looks_like_quantity(given):
        try:
            return to_unit(given, unit)
        except UnitError as error:
            raise PydanticCustomError(
                "wrong_unit", "wrong unit", {"key": key, "given": given, "expected": str(error)}
            ) from None
    return given
