"""The reference of the command line, from its own help."""

from __future__ import annotations

import os
from pathlib import Path

from generators.text import heading, literal, write_if_changed
from nigemizu.cli.parser import _parsers

__all__ = ["write"]


def write(path: Path) -> None:
    # argparse wraps its help to the width of the terminal.
    columns = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "96"
    try:
        parser, verbs = _parsers()
        text = literal(parser.format_help())
        for name, verb in verbs.items():
            text += heading(name, "-") + literal(verb.format_help())
    finally:
        if columns is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = columns
    write_if_changed(path, text)
