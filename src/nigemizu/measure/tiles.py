"""Where a picture has texture to hold on to, and in which directions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError

__all__ = ["BORDER", "SMOOTHING", "Texture", "grid_of_tiles", "texture_of"]

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.intp]

SMOOTHING: Final = 1.0
"""Standard deviation, in pixels, of the Gaussian that takes off what no interpolation brings back."""

BORDER: Final = 4
"""Pixels around a tile that interpolation and derivatives look at."""

_CONTRAST: Final = 0.003  # per pixel, root mean square: under one step of 8 bits
_ROUND: Final = 0.03  # smaller over larger eigenvalue of the structure tensor below which a tile is an edge
_UPRIGHT: Final = math.cos(math.radians(15))
_MOST: Final = 900


@final
@dataclass(frozen=True)
class Texture:
    """What tiles can tell, (M,) each.

    Attributes
    ----------
    along_x, along_y : (M,) bool
        Whether the tile has texture that shows motion along x and along y.
    edge : (M,) bool
        Whether it has texture in one direction only: only the motion across its edges shows.
    direction : (M, 2) float64
        That direction, as a unit vector (x, y); the strongest one of other tiles.
    radius : (M,) float64, pixels
        Of the disc whose second moment the texture has within the tile.
    """

    along_x: NDArray[np.bool_]
    along_y: NDArray[np.bool_]
    edge: NDArray[np.bool_]
    direction: FloatArray
    radius: FloatArray

    def kind(self, index: int) -> str:
        """``xy``, ``x``, ``y``, ``oblique`` (an edge at an angle) or ``none``."""
        words = "x" * bool(self.along_x[index]) + "y" * bool(self.along_y[index])
        return words or ("oblique" if self.edge[index] else "none")


def grid_of_tiles(shape: tuple[int, int], tile: int | None, search: int | None) -> tuple[IntArray, int, int]:
    """Tiles side by side all over a picture.

    Parameters
    ----------
    shape : (int, int), pixels
        Height and width.
    tile : int, pixels, optional
        Side of a tile; 16 to 64 unless given, by the size of the picture.
    search : int, pixels, optional
        How far a tile may move, which keeps it off the border of the picture by as much; 12 unless given, or
        half a tile where this is less.

    Returns
    -------
    corners : (M, 2) int
        Row and column of the first pixel.
    tile, search : int, pixels

    Raises
    ------
    InputError
        The picture is too small.
    """
    height, width = shape
    side = int(np.clip(round(math.sqrt(height * width / 400)), 16, 64)) if tile is None else tile
    reach = min(12, side // 2) if search is None else search
    if side < 8:
        raise InputError(
            "tiles are too small to be followed", key="--tile", value=tile, expected="≥ 8 pixels"
        )
    if reach < 2:
        raise InputError("tiles could not move", key="--search", value=search, expected="≥ 2 pixels")
    margin = reach + BORDER
    rows, columns = (height - 2 * margin) // side, (width - 2 * margin) // side
    if rows < 1 or columns < 1:
        raise InputError(
            f"no tile of {side} pixels that may move by {reach} fits into a picture of {width}×{height}",
            key="--tile",
            value=tile,
            expected=f"frames of {side + 2 * margin} pixels at least",
            remedy="state a smaller --tile and --search",
        )
    if rows * columns > _MOST:
        raise InputError(
            f"{rows * columns} tiles are too many",
            key="--tile",
            value=side,
            expected=f"{math.ceil(math.sqrt(height * width / _MOST))} pixels or more",
        )
    y = (height - rows * side) // 2 + side * np.arange(rows)
    x = (width - columns * side) // 2 + side * np.arange(columns)
    corners = np.stack(np.meshgrid(y, x, indexing="ij"), axis=-1).reshape(-1, 2)
    return corners, side, reach


def gradients(patches: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives along x and y of patches (M, h, h), of fourth order, without two pixels at each side."""
    inner = slice(2, -2)

    def along(p: FloatArray) -> FloatArray:
        return (8 * (p[..., 3:-1] - p[..., 1:-3]) - (p[..., 4:] - p[..., :-4])) / 12

    gx = along(patches[:, inner, :])
    gy = along(patches[:, :, inner].swapaxes(1, 2)).swapaxes(1, 2)
    return gx, gy


def texture_of(patches: FloatArray) -> Texture:
    """Texture of patches (M, h, h) that reach `BORDER` pixels beyond their tiles.

    Notes
    -----
    The structure tensor ⟨∇I ∇Iᵀ⟩ of a tile has two eigenvalues. Where the smaller one is below 3 % of the
    larger, or below 0.003 of white per pixel (root), the tile has edges of one direction: they show motion
    across themselves and none along (the aperture problem). Such a tile counts for x or for y where its
    edges stand within 15° of upright or level, and for neither axis otherwise.
    """
    cut = BORDER - 2
    inner = slice(cut, -cut) if cut else slice(None)
    gx, gy = (g[:, inner, inner] for g in gradients(patches))
    tensor = np.empty((patches.shape[0], 2, 2))
    tensor[:, 0, 0], tensor[:, 1, 1] = (gx**2).mean((1, 2)), (gy**2).mean((1, 2))
    tensor[:, 0, 1] = tensor[:, 1, 0] = (gx * gy).mean((1, 2))
    values, vectors = np.linalg.eigh(tensor)
    strong = values[:, 1] >= _CONTRAST**2
    both = strong & (values[:, 0] >= _CONTRAST**2) & (values[:, 0] >= _ROUND * values[:, 1])
    edge = strong & ~both
    direction = vectors[:, :, 1]
    along_x = both | (edge & (np.abs(direction[:, 0]) >= _UPRIGHT))
    along_y = both | (edge & (np.abs(direction[:, 1]) >= _UPRIGHT))
    return Texture(along_x, along_y, edge, direction, _radius(gx**2 + gy**2))


def _radius(weight: FloatArray) -> FloatArray:
    """Radius of the disc with the second moment of `weight` (M, n, n)."""
    place = np.arange(weight.shape[1], dtype=np.float64)
    total = np.maximum(weight.sum((1, 2)), 1e-300)
    moment = np.zeros(weight.shape[0])
    for axis in (1, 2):
        share = weight.sum(axis) / total[:, None]
        mean = share @ place
        moment += share @ place**2 - mean**2
    # of a disc the sum of both axes is R²/2; a pixel itself has 1/12 on each
    return np.asarray(np.sqrt(2 * (np.maximum(moment, 0.0) + 1 / 6)))
