"""The JSON schema of scene files, for editors that complete and check TOML."""

from __future__ import annotations

import inspect
from typing import Any

from nigemizu.scene.descriptions import described_fields, summary
from nigemizu.units import accepted_units
from nigemizu.values import Value, field_unit

__all__ = ["schema"]

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def schema(root: type[Value]) -> dict[str, Any]:
    """JSON schema of `root`, with the documented meaning, unit and accepted units of every key."""
    found = root.model_json_schema()
    known = {value.__name__: value for value in _values()}
    for name, definition in {root.__name__: found, **found.get("$defs", {})}.items():
        if name in known:
            _describe(definition, known[name])
    return {"$schema": _DIALECT, **found}


def _describe(definition: dict[str, Any], value: type[Value]) -> None:
    definition["description"] = summary(value)
    meanings = described_fields(value)
    for key, entry in definition.get("properties", {}).items():
        unit = field_unit(value.model_fields[key])
        texts = [meanings.get(key, ""), f"[{unit}]" if unit else ""]
        entry["description"] = " ".join(filter(None, texts)) or key.replace("_", " ")
        if unit is not None:
            entry["unit"] = unit
            _accept_units(entry, unit)


def _accept_units(entry: dict[str, Any], unit: str) -> None:
    """Let an editor accept ``"1.5 km"`` wherever a number with a unit is wanted."""
    text = {"type": "string", "description": f"a number with a unit: {', '.join(accepted_units(unit))}"}
    if entry.get("type") == "number":
        limits = {name: entry.pop(name) for name in _LIMITS if name in entry}
        del entry["type"]
        entry["anyOf"] = [{"type": "number", **limits}, text]
    elif "anyOf" in entry:
        if any(other.get("type") == "number" for other in entry["anyOf"]):
            entry["anyOf"] = [*entry["anyOf"], text]
        for other in entry["anyOf"]:
            if other.get("type") == "array":
                _accept_units(other, unit)
    for name in ("items", "additionalItems"):
        if isinstance(entry.get(name), dict):
            _accept_units(entry[name], unit)
    for position in entry.get("prefixItems", ()):
        _accept_units(position, unit)


_LIMITS = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")


def _values() -> list[type[Value]]:
    """Every concrete value that has been defined."""
    found: list[type[Value]] = []
    waiting = list(Value.__subclasses__())
    while waiting:
        value = waiting.pop()
        waiting.extend(value.__subclasses__())
        if not inspect.isabstract(value):
            found.append(value)
    return found
