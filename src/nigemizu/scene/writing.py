"""From a value to TOML that a person can edit: the unit and the meaning of every key stand beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

from nigemizu.heat.quantity import Quantity
from nigemizu.scene.descriptions import described_fields, first_sentence
from nigemizu.values import Value, field_unit

__all__ = ["to_toml"]

# Longer rows push their own comment to the right, not everyone's.
_WIDEST = 40


def to_toml(value: Value, *, comments: bool = False) -> str:
    """Write a value as TOML that reads back into an equal value.

    Parameters
    ----------
    value : Value
        What to write.
    comments : bool
        Whether to put the unit and the meaning of each key beside it, and to list unset keys as comments.

    Returns
    -------
    str
        TOML 1.0 text ending in a newline.
    """
    lines: list[str] = []
    _table(lines, value, "", comments)
    return "\n".join(lines).strip("\n") + "\n"


def _table(lines: list[str], value: Value, prefix: str, comments: bool) -> None:
    """Keys first, then sub-tables: TOML gives everything after a header to that header."""
    nested: list[tuple[str, Any]] = []
    rows: list[tuple[str, str]] = []
    meanings = described_fields(type(value)) if comments else {}
    for name, field in type(value).model_fields.items():
        content = _simplest(getattr(value, name))
        if isinstance(content, Value) or _is_table_list(content):
            nested.append((name, content))
            continue
        unit = field_unit(field)
        words = [f"[{unit}]" if unit else "", first_sentence(meanings.get(name, ""))]
        remark = " ".join(filter(None, words))
        if content is not None:
            rows.append((f"{name} = {_literal(content)}", remark))
        elif comments:
            rows.append((f"# {name} =", f"{remark} (unset)".strip()))
    width = max((len(text) for text, _ in rows if len(text) <= _WIDEST), default=0)
    for text, remark in rows:
        lines.append(f"{text:{width}}  # {remark}" if comments and remark else text)
    for name, content in nested:
        path = f"{prefix}{name}"
        for entry in content if isinstance(content, tuple | list) else (content,):
            brackets = ("[[", "]]") if isinstance(content, tuple | list) else ("[", "]")
            lines.extend(("", f"{brackets[0]}{path}{brackets[1]}"))
            _table(lines, entry, f"{path}.", comments)


def _simplest(content: Any) -> Any:
    """A quantity that does not vary is written as the number that it is."""
    if isinstance(content, Quantity) and content.is_constant and not content.patterns:
        return content.value
    return content


def _is_table_list(content: Any) -> bool:
    return (
        isinstance(content, tuple | list) and bool(content) and all(isinstance(one, Value) for one in content)
    )


def _literal(content: Any) -> str:
    if isinstance(content, bool):
        return "true" if content else "false"
    if isinstance(content, Enum):
        return _literal(content.value)
    if isinstance(content, int | float):
        return repr(content)
    if isinstance(content, str | Path):
        # A JSON string is a TOML basic string, but TOML also forbids a raw DEL.
        return json.dumps(str(content), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(content, tuple | list):
        return f"[{', '.join(map(_literal, content))}]"
    if isinstance(content, Value):
        content = {name: getattr(content, name) for name in type(content).model_fields}
    if isinstance(content, Mapping):
        pairs = (f"{_key(name)} = {_literal(one)}" for name, one in content.items() if one is not None)
        return f"{{ {', '.join(pairs)} }}"
    raise TypeError(f"a {type(content).__name__} has no TOML form")


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() and name.isascii() else json.dumps(name)
