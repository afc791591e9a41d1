"""Small pieces of reStructuredText."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

__all__ = ["escaped", "heading", "literal", "table", "write_if_changed"]


def escaped(text: str) -> str:
    """`text` without any of its characters being taken for markup."""
    return re.sub(r"([\\`*_|])", r"\\\1", text)


def heading(title: str, mark: str) -> str:
    return f"{title}\n{mark * max(len(title), 4)}\n\n"


def literal(text: str, language: str = "text") -> str:
    return f".. code-block:: {language}\n\n{textwrap.indent(text.rstrip(), '   ')}\n\n"


def table(header: Sequence[str], rows: Iterable[Sequence[str]], widths: Sequence[int]) -> str:
    lines = [".. list-table::", "   :header-rows: 1", f"   :widths: {' '.join(map(str, widths))}", ""]
    for row in (header, *rows):
        lines += [f"   {'* -' if index == 0 else '  -'} {cell}".rstrip() for index, cell in enumerate(row)]
    return "\n".join(lines) + "\n\n"


def write_if_changed(path: Path, text: str) -> None:
    """Leave the file's time alone when nothing changed, so that Sphinx does not read it again."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
