"""What all figures share: the kinds of their files, and what these say of their making."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nigemizu.errors import InputError
from nigemizu.output.files import write_bytes
from nigemizu.output.provenance import Provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["figure_file", "write_figure"]


def figure_file(path: str | Path) -> tuple[Path, str]:
    """The path of a figure and its extension, refused unless it is ``.svg``, ``.png`` or ``.pdf``."""
    target = Path(path)
    kind = target.suffix.lower()
    if kind not in (".svg", ".png", ".pdf"):
        raise InputError(
            "unknown kind of diagram", file=str(target), value=kind, expected=".svg, .png or .pdf"
        )
    return target, kind


def _metadata(kind: str, provenance: Provenance) -> dict[str, Any]:
    """What made a figure, in the fields of its kind; without dates, so that equal figures are equal files."""
    fields = provenance.fields()
    if kind == ".png":
        return dict(fields)
    about = "\n".join(text for name, text in fields.items() if name != "Software")
    if kind == ".svg":
        return {"Creator": provenance.software, "Date": None, "Description": about}
    return {"Creator": provenance.software, "CreationDate": None, "Subject": about}


def write_figure(figure: Figure, target: Path, kind: str, provenance: Provenance | None) -> Path:
    """Write a figure to the file and of the kind that `figure_file` gave, whole or not at all."""
    buffer = io.BytesIO()
    metadata = _metadata(kind, provenance or Provenance())
    figure.savefig(buffer, format=kind[1:], dpi=160, metadata=metadata)
    return write_bytes(target, buffer.getvalue())
