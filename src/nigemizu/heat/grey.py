"""Grey pictures as maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nigemizu.errors import InputError

__all__ = ["bilinear", "read_grey"]


def read_grey(file: Path) -> np.ndarray:
    """Luminance of a picture, (rows, columns) float64 in 0..1, first row at the top."""
    from PIL import Image as Pictures
    from PIL import UnidentifiedImageError

    path = file.expanduser()
    try:
        with Pictures.open(path) as picture:
            deep = picture.mode.startswith("I") or picture.mode == "F"
            grey = np.asarray(picture if deep else picture.convert("L"), dtype=np.float64)
            grey = grey / (65535.0 if picture.mode.startswith("I") else 1.0 if picture.mode == "F" else 255.0)
    except FileNotFoundError:
        raise InputError("no such picture", key="pattern.file", value=str(file)) from None
    except (UnidentifiedImageError, OSError) as error:
        raise InputError(f"cannot read the picture: {error}", key="pattern.file", value=str(file)) from None
    low, high = float(np.min(grey)), float(np.max(grey))  # NaN if any is
    if not (low >= 0.0 and high <= 1.0):
        raise InputError(
            f"the grey values of the picture reach from {low:g} to {high:g}",
            key="pattern.file",
            value=str(file),
            expected="numbers between 0 (black) and 1 (white), or integers of 8 or 16 bits",
        )
    return grey


def bilinear(grey: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Grey at fractional rows and columns, linear between the pixels and constant beyond the outer ones."""
    rows, columns = grey.shape
    row, column = np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)
    r0, c0 = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    r1, c1 = np.minimum(r0 + 1, rows - 1), np.minimum(c0 + 1, columns - 1)
    fr, fc = row - r0, column - c0
    upper = (1 - fc) * grey[r0, c0] + fc * grey[r0, c1]
    lower = (1 - fc) * grey[r1, c0] + fc * grey[r1, c1]
    return np.asarray((1 - fr) * upper + fr * lower)
