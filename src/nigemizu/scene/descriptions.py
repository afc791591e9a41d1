"""What each key of a scene means, read from the documentation of its value.

The values are documented once, in numpydoc sections; ``show`` and the JSON schema repeat those words.
"""

from __future__ import annotations

import inspect
import re

from nigemizu.values import Value

__all__ = ["described_fields", "first_sentence", "summary"]

_SECTION = re.compile(r"^(Parameters|Attributes)\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)", re.MULTILINE | re.DOTALL)
_ENTRY = re.compile(r"^(\w[\w, ]*?) : [^\n]*\n((?:[ \t]+[^\n]*\n|\n)*)", re.MULTILINE)


def summary(value: type[Value]) -> str:
    """First sentence of a value's documentation."""
    return " ".join((inspect.getdoc(value) or "").split("\n\n")[0].split())


def described_fields(value: type[Value]) -> dict[str, str]:
    """Meaning of each field that `value` documents, in one line."""
    meanings = {name: field.description for name, field in value.model_fields.items() if field.description}
    text = "\n".join(section for _, section in _SECTION.findall((inspect.getdoc(value) or "") + "\n"))
    for names, body in _ENTRY.findall(text + "\n"):
        meaning = _plain(" ".join(body.split()))
        for name in names.split(","):
            meanings.setdefault(name.strip(), meaning)
    return {name: meaning for name, meaning in meanings.items() if name in value.model_fields and meaning}


def first_sentence(text: str) -> str:
    """What stands beside a key; the whole meaning is in the schema and the documentation."""
    return re.split(r"(?<=\w{2}[.)])\s+(?=[A-Z])", text, maxsplit=1)[0].rstrip(".")


def _plain(text: str) -> str:
    without_marks = re.sub(r":math:`([^`]*)`", r"\1", text)
    return re.sub(r"``\"?([^`]*?)\"?``", r'"\1"', without_marks).replace("`", "")
