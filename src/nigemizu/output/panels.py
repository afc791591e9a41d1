"""Several pictures of the same size in one, each with its name on it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from nigemizu.errors import InputError
from nigemizu.output.pictures import Highlights, encoded, write_png
from nigemizu.output.provenance import Provenance

__all__ = ["write_panels"]

_GAP: Final = 4  # pixels between panels
_MARGIN: Final = 0.5  # of the letters' height, around the name


def write_panels(
    path: str | Path,
    panels: Sequence[tuple[str, ArrayLike]],
    *,
    highlights: Highlights = "clip",
    provenance: Provenance | None = None,
) -> Path:
    """Write labelled pictures as one PNG: wide ones one above the other, tall ones side by side.

    Parameters
    ----------
    path : path
        ``.png``.
    panels : sequence of (str, (height, width, 3) array_like)
        Name and linear radiance of each picture.
    highlights : {"clip", "soft", "film"}
        As in `nigemizu.output.pictures.encoded`.
    provenance : Provenance, optional
        Kept in text chunks.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        There is no picture, or they differ in size; or as `write_png`.
    """
    from PIL import Image, ImageDraw, ImageFont

    pictures = [(name, encoded(radiance, highlights=highlights)) for name, radiance in panels]
    shapes = {pixels.shape for _, pixels in pictures}
    if len(shapes) != 1:
        raise InputError("pictures of one size are needed", key="panels", value=sorted(shapes))
    height, width, _ = shapes.pop()
    down = width >= height
    count = len(pictures)
    size = (width, count * (height + _GAP) - _GAP) if down else (count * (width + _GAP) - _GAP, height)
    sheet = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(sheet, "RGBA")
    letters = max(10, min(height, width) // 18)
    font = ImageFont.load_default(letters)
    for index, (name, pixels) in enumerate(pictures):
        corner = (0, index * (height + _GAP)) if down else (index * (width + _GAP), 0)
        sheet.paste(Image.fromarray(pixels), corner)
        margin = int(letters * _MARGIN)
        place = (corner[0] + 2 * margin, corner[1] + 2 * margin)
        left, top, right, bottom = draw.textbbox(place, name, font=font)
        # A dark plate keeps the name readable on sky and sand alike.
        draw.rectangle((left - margin, top - margin, right + margin, bottom + margin), fill=(0, 0, 0, 150))
        draw.text(place, name, font=font, fill="white")
    return write_png(path, np.asarray(sheet), provenance=provenance)
