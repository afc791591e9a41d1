"""From TOML text and overrides to a validated value, with every refusal as one line."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from nigemizu.errors import InputError
from nigemizu.values import Value

__all__ = ["apply_overrides", "parse_assignment", "parse_toml", "read_text", "validate"]

_Model = TypeVar("_Model", bound=Value)
# What pydantic calls it → what a person would have had to write.
_EXPECTED: dict[str, str] = {
    "float": "a number",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "a text in quotes",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "finite_number": "a finite number",
    "tuple_type": "a list [ … ]",
    "list_type": "a list [ … ]",
    "path_type": "a file name in quotes",
    "model_type": "a table { … }",
    "model_attributes_type": "a table { … }",
    "dict_type": "a table { … }",
    "none_required": "nothing",
}
_COMPARISONS: dict[str, str] = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
# Errors that only say "this alternative was not meant", or that follow from another error.
_MISMATCH = re.compile(r"(_type|_parsing)$|^(wrong_type|none_required|int_from_float|too_short)$")
_OWN_KEY = re.compile(r"(\w+): (.*)", re.DOTALL)


def read_text(path: Path) -> str:
    """Read a TOML file as text.

    Raises
    ------
    InputError
        If the file cannot be read or is not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=str(path)) from error
    except UnicodeDecodeError as error:
        raise InputError("is not a text file", file=str(path), expected="TOML in UTF-8") from error


def parse_toml(text: str, file: str | None) -> dict[str, Any]:
    """Parse TOML; a syntax error names the file and the line."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not valid TOML: {error}", file=file) from error


def parse_assignment(text: str) -> tuple[str, Any]:
    """Split ``section.key=value``; the value is read as TOML, or else taken as a text.

    Examples
    --------
    >>> parse_assignment("grid.cells=[8, 1, 8]")
    ('grid.cells', [8, 1, 8])
    >>> parse_assignment("camera.distance=1.5 km")
    ('camera.distance', '1.5 km')
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError("cannot be understood", key="--set", value=text, expected="section.key=value")
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()


def apply_overrides(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return `data` with ``{"section.key": value}`` replaced; numbers step into lists (``objects.0.x``)."""
    changed = copy.deepcopy(dict(data))
    for dotted, value in overrides.items():
        *parents, last = dotted.split(".")
        place: Any = changed
        for part in parents:
            place = _step_into(place, part, dotted)
        if isinstance(place, list):
            place[_index(place, last, dotted)] = value
        elif isinstance(place, dict):
            place[last] = value
        else:
            raise InputError("has no keys inside", key=".".join(parents), value=place)
    return changed


def _step_into(place: Any, part: str, dotted: str) -> Any:
    if isinstance(place, list):
        return place[_index(place, part, dotted)]
    if not isinstance(place, dict):
        raise InputError("has no keys inside it", key=dotted, value=place)
    return place.setdefault(part, {})


def _index(place: list[Any], part: str, dotted: str) -> int:
    if not part.isdigit() or int(part) >= len(place):
        raise InputError("names no entry", key=dotted, value=part, expected=f"0 to {len(place) - 1}")
    return int(part)


def validate(
    model: type[_Model], data: Mapping[str, Any], *, file: str | None, folder: Path | None
) -> _Model:
    """Make `model` from `data`.

    Raises
    ------
    InputError
        In one line: the file, the dotted key, the value, what was expected, and the remedy if one is known.
    """
    try:
        return model.model_validate(dict(data), context={"folder": folder})
    except ValidationError as error:
        raise _one_line(error, data, file) from None
    except InputError as error:
        # A room's own check knows its key but not the file.
        raise error.in_file(file) from error


def _one_line(error: ValidationError, data: Mapping[str, Any], file: str | None) -> InputError:
    found: dict[str, list[dict[str, Any]]] = {}
    for entry in error.errors(include_url=False):
        item: dict[str, Any] = dict(entry)
        found.setdefault(_dotted_key(item, data), []).append(item)
    # A union reports one error per alternative. The alternative that got furthest is the one that was meant.
    key = max(found, key=lambda dotted: (_is_specific(found[dotted]), dotted.count(".")))
    items = found[key]
    specific = [item for item in items if not _MISMATCH.search(item["type"])]
    item = (specific or items)[0]
    context: dict[str, Any] = item.get("ctx", {})
    remedy = context.get("remedy")
    # The other alternatives of a union, and what only follows from this error, are no further mistakes.
    others = sum(
        not key.startswith(dotted) and (_is_specific(group) or not _is_specific(items))
        for dotted, group in found.items()
    )
    if others:
        remedy = f"{remedy + '; ' if remedy else ''}{others} more to mend after this one"
    return InputError(
        _problem(item),
        key=key,
        file=file,
        value=_value(item),
        expected=" or ".join(dict.fromkeys(filter(None, map(_expected, specific or items)))),
        remedy=remedy,
    )


def _is_specific(items: Sequence[Mapping[str, Any]]) -> bool:
    return any(not _MISMATCH.search(item["type"]) for item in items)


def _dotted_key(item: Mapping[str, Any], data: Any) -> str:
    """The key as the person wrote it: pydantic's location without the names of union alternatives."""
    names: list[str] = []
    place: Any = data
    location = item["loc"]
    for position, part in enumerate(location):
        in_table = isinstance(place, Mapping) and part in place
        in_list = isinstance(place, list | tuple) and isinstance(part, int) and part < len(place)
        if in_table or in_list:
            place = place[part]
        elif item["type"] != "missing" or position != len(location) - 1:
            continue
        names.append(str(part))
    key = item.get("ctx", {}).get("key")
    discriminator = item.get("ctx", {}).get("discriminator")
    own = _OWN_KEY.match(str(item.get("ctx", {}).get("error", "")))
    if own and isinstance(place, Mapping) and own[1] in place:
        names.append(own[1])  # a rule about several keys that names the one at fault
    if key is not None:
        names.append(str(key))
    elif isinstance(discriminator, str):
        names.append(discriminator.strip("'"))
    return ".".join(names)


def _problem(item: Mapping[str, Any]) -> str:
    kind = item["type"]
    if kind == "missing" or kind == "union_tag_not_found":
        return "is missing"
    if kind in ("unknown_key", "wrong_unit", "wrong_type"):
        return str(item["msg"])
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        return "unknown key"
    if kind in ("value_error", "assertion_error"):
        text = str(item["ctx"]["error"])
        own = _OWN_KEY.match(text)
        return own[2] if own and isinstance(item["input"], Mapping) and own[1] in item["input"] else text
    if kind in ("literal_error", "enum", "union_tag_invalid"):
        return "unknown word"
    limited = any(name in item.get("ctx", {}) for name in _COMPARISONS)
    if limited or kind in ("too_short", "too_long", "finite_number"):
        return "out of range"
    if kind in _EXPECTED:
        return "wrong type"
    return str(item["msg"])


def _value(item: Mapping[str, Any]) -> object:
    context = item.get("ctx", {})
    if item["type"] in ("missing", "unknown_key", "union_tag_not_found"):
        return None
    if item["type"] == "union_tag_invalid":
        return context["tag"]
    if item["type"] == "value_error" and isinstance(item["input"], dict):
        own = _OWN_KEY.match(str(context["error"]))
        return item["input"].get(own[1]) if own else None
    return context.get("given", item["input"])


def _expected(item: Mapping[str, Any]) -> str | None:
    kind, context = item["type"], item.get("ctx", {})
    if kind in ("literal_error", "enum"):
        return str(context["expected"])
    if kind == "union_tag_invalid":
        return f"one of {context['expected_tags']}"
    if kind in ("too_short", "too_long"):
        limit = context.get("min_length", context.get("max_length"))
        return f"{'at least' if kind == 'too_short' else 'at most'} {limit} entries"
    for name, sign in _COMPARISONS.items():
        if name in context:
            return f"a number {sign} {context[name]}"
    if kind == "missing":
        return None
    if context.get("class_name") == "Quantity":
        return "a number or a table { … }"
    return context.get("expected") or _EXPECTED.get(kind)
