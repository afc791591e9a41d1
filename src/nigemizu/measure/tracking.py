"""Displacements of tiles to a small fraction of a pixel, and how much noise is in them."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

from nigemizu.measure.tiles import BORDER, SMOOTHING, IntArray, Texture, gradients

__all__ = ["Displacements", "Follower", "Searcher", "coefficients_of", "smoothed", "warped"]

FloatArray: TypeAlias = NDArray[np.float64]

DEGREE: Final = 5
"""Of the splines: cubic ones would turn 0.05 pixels of fine texture into 0.0503."""

_ITERATIONS: Final = 5
_ENOUGH: Final = 5e-4  # pixels
_HOME: Final = 0.02  # correlation that the far end of the search has to be better by
_ALIKE: Final = 0.5  # correlation below which a tile is lost


def smoothed(frame: NDArray[np.float32]) -> FloatArray:
    """A frame without what lies near the sampling limit, float64."""
    return np.asarray(ndimage.gaussian_filter(frame.astype(np.float64), SMOOTHING, mode="nearest"))


@final
@dataclass(frozen=True)
class Displacements:
    """Of all tiles in one frame.

    Attributes
    ----------
    value : (M, 2) float64, pixels
        Along x (to the right) and y (downwards).
    noise : (M, 2) float64, pixels²
        Variance that noise of the pixels gives each of them.
    found : (M,) bool
        Whether the tile was found within reach.
    """

    value: FloatArray
    noise: FloatArray
    found: NDArray[np.bool_]


@final
class Searcher:
    """Finds patches again by normalised correlation over whole pixels.

    Parameters
    ----------
    corners : (M, 2) int
        Row and column of each tile's first pixel.
    size, reach : int, pixels
        Side of a tile, and how far it may move.
    """

    def __init__(self, corners: IntArray, size: int, reach: int) -> None:
        self.corners, self.size, self.reach = corners, size, reach
        side = size + 2 * reach
        self._rows = (corners[:, 0, None] - reach + np.arange(side))[:, :, None]
        self._columns = (corners[:, 1, None] - reach + np.arange(side))[:, None, :]
        self._side = fft.next_fast_len(side, real=True)
        steps = np.arange(-reach, reach + 1)
        self._home = _HOME * (steps[:, None] ** 2 + steps[None, :] ** 2) / reach**2

    def patches(self, frame: FloatArray, border: int = 0) -> FloatArray:
        """What a frame shows at the tiles, with `border` pixels around: (M, size + 2 border, …)."""
        place = np.arange(-border, self.size + border)
        rows, columns = (self.corners[:, axis, None] + place for axis in (0, 1))
        return np.asarray(frame[rows[:, :, None], columns[:, None, :]])

    def transform(self, patches: FloatArray) -> tuple[NDArray[np.complex128], FloatArray]:
        """What `find` needs to know of the patches (M, size, size) that are looked for."""
        centred = patches - patches.mean((1, 2), keepdims=True)
        spectrum = np.conj(fft.rfft2(centred, (self._side, self._side)))
        return spectrum, np.sqrt((centred**2).sum((1, 2)))

    def find(
        self, frame: FloatArray, wanted: tuple[NDArray[np.complex128], FloatArray]
    ) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
        """Displacement (M, 2) in pixels along x and y, correlation (M,), and whether it is within reach.

        Repeated patterns are found at the nearest of equally good places.
        """
        windows = frame[self._rows, self._columns]
        windows = windows - windows.mean((1, 2), keepdims=True)
        spectrum, norm = wanted
        places = slice(0, 2 * self.reach + 1)
        found = fft.irfft2(fft.rfft2(windows, (self._side, self._side)) * spectrum, (self._side, self._side))[
            :, places, places
        ]
        variance = _box(windows**2, self.size) - _box(windows, self.size) ** 2 / self.size**2
        scale = norm[:, None, None] * np.sqrt(np.maximum(variance, 1e-14))
        score = np.where(scale > 1e-9, found / np.maximum(scale, 1e-9), 0.0)
        flat = (score - self._home).reshape(len(score), -1).argmax(1)
        row, column = np.unravel_index(flat, score.shape[1:])
        inside = (np.minimum(row, column) > 0) & (np.maximum(row, column) < 2 * self.reach)
        index = np.arange(len(score))
        r, c = np.clip(row, 1, 2 * self.reach - 1), np.clip(column, 1, 2 * self.reach - 1)
        dx = _parabola(score[index, r, c - 1], score[index, r, c], score[index, r, c + 1])
        dy = _parabola(score[index, r - 1, c], score[index, r, c], score[index, r + 1, c])
        value = np.stack([c + dx, r + dy], axis=1) - self.reach
        best = score[index, row, column]
        return value, best, inside & (best >= _ALIKE)


def _box(values: FloatArray, size: int) -> FloatArray:
    """Sums over all squares of `size` pixels within (M, h, h)."""
    sums = np.zeros((values.shape[0], values.shape[1] + 1, values.shape[2] + 1))
    sums[:, 1:, 1:] = values.cumsum(1).cumsum(2)
    return np.asarray(
        sums[:, size:, size:] - sums[:, :-size, size:] - sums[:, size:, :-size] + sums[:, :-size, :-size]
    )


def _parabola(before: FloatArray, at: FloatArray, after: FloatArray) -> FloatArray:
    bend = before - 2 * at + after
    place = 0.5 * (before - after) / np.where(bend < 0, bend, -1.0)
    return np.asarray(np.where(bend < 0, np.clip(place, -0.5, 0.5), 0.0))


@final
class Follower:
    """Follows templates by least squares on their gradients, starting from where a `Searcher` finds them.

    Parameters
    ----------
    searcher : Searcher
    templates : (M, h, h) float64
        Smoothed mean pictures of the tiles with `BORDER` pixels around.
    texture : Texture
        Of the templates; an edge is followed across itself alone.

    Notes
    -----
    The frame I moved back by d is fitted as I(x + d) = a T(x) + b + a ∇T·δ, which gives δ, and d becomes
    d − δ until it rests; gain a and offset b leave changes of brightness out. The gradient is that of the
    template, a mean over all frames, so that the noise of a frame moves d without pulling it towards 0, and
    a template that is itself blurred by the motion leaves d where it is. I is interpolated by splines of
    degree 5 after a Gaussian of 1 pixel.

    White noise of variance σ² in the pixels gives d the variance σ² Σ (G∗p)², p being the row of the
    pseudo-inverse for d and G the Gaussian; σ² comes from what the fit leaves.

    References
    ----------
    B. D. Lucas, T. Kanade, Proc. IJCAI (1981) 674. S. Baker, I. Matthews, Int. J. Comput. Vis. 56 (2004)
    221, doi:10.1023/B:VISI.0000011205.11775.fd: the roles of frame and template exchanged.
    """

    def __init__(self, searcher: Searcher, templates: FloatArray, texture: Texture) -> None:
        self._searcher, self._texture = searcher, texture
        inner = slice(BORDER, -BORDER)
        core = templates[:, inner, inner]
        self._wanted = searcher.transform(core)
        count, size = core.shape[0], searcher.size
        cut = slice(BORDER - 2, -(BORDER - 2))
        gx, gy = (g[:, cut, cut].reshape(count, -1) for g in gradients(templates))
        # an edge has one column, along its own direction
        nx, ny = texture.direction.T[:, :, None]
        edge = texture.edge[:, None]
        columns = [np.where(edge, nx * gx + ny * gy, gx), np.where(edge, 0.0, gy)]
        flat = core.reshape(count, -1)
        self._design = np.stack([flat, np.ones_like(flat), *columns], axis=2)
        self._inverse = np.linalg.pinv(self._design, rcond=1e-10)
        rows = self._inverse[:, 2:].reshape(-1, size, size)
        wide = np.pad(rows, ((0, 0), (BORDER, BORDER), (BORDER, BORDER)))
        spread = ndimage.gaussian_filter(wide, (0, SMOOTHING, SMOOTHING))
        self._gain = (spread**2).sum((1, 2)).reshape(count, 2) / _remaining_noise()
        self._basis = np.zeros((count, 2, 2))  # from the columns to x and y
        self._basis[:, 0, 0], self._basis[:, 1, 1] = 1.0, 1.0
        self._basis[texture.edge, :, 0] = texture.direction[texture.edge]
        self._basis[texture.edge, :, 1] = 0.0

    def follow(self, frame: FloatArray) -> Displacements:
        """Displacements of the tiles in a smoothed frame."""
        value, _, found = self._searcher.find(frame, self._wanted)
        edge = self._texture.edge
        n = self._texture.direction[edge]
        value[edge] = n * (value[edge] * n).sum(1, keepdims=True)
        coefficients = coefficients_of(frame)
        for _ in range(_ITERATIONS):
            shown = warped(coefficients, self._searcher, value)
            fit = np.einsum("mkn,mn->mk", self._inverse, shown)
            gain = np.where(np.abs(fit[:, 0]) > 0.05, fit[:, 0], 1.0)
            step = np.einsum("mij,mj->mi", self._basis, fit[:, 2:]) / gain[:, None]
            value = value - np.clip(step, -1.0, 1.0)
            if not found.any() or np.abs(step[found]).max() < _ENOUGH:
                break
        rest = shown - np.einsum("mnk,mk->mn", self._design, fit)
        white = (rest**2).sum(1) / (rest.shape[1] - 4)
        noise = np.einsum("mij,mj->mi", self._basis**2, white[:, None] * self._gain) / gain[:, None] ** 2
        found &= (np.abs(value) <= self._searcher.reach).all(1)
        return Displacements(value, noise, found)


def coefficients_of(frame: FloatArray) -> FloatArray:
    """Of the splines that interpolate a smoothed frame."""
    return np.asarray(ndimage.spline_filter(frame, order=DEGREE, mode="mirror"))


def warped(coefficients: FloatArray, searcher: Searcher, value: FloatArray, border: int = 0) -> FloatArray:
    """What the tiles, moved by `value` (M, 2), show: (M, (size + 2 border)²)."""
    place = np.arange(-border, searcher.size + border)
    rows = searcher.corners[:, 0, None] + value[:, 1, None] + place
    columns = searcher.corners[:, 1, None] + value[:, 0, None] + place
    side = place.size
    points = np.empty((2, len(value), side, side))
    points[0], points[1] = rows[:, :, None], columns[:, None, :]
    shown = ndimage.map_coordinates(coefficients, points, order=DEGREE, mode="mirror", prefilter=False)
    return np.asarray(shown).reshape(len(value), -1)


@functools.cache
def _remaining_noise() -> float:
    """Variance that white noise of variance 1 keeps under the Gaussian."""
    point = np.zeros((33, 33))
    point[16, 16] = 1.0
    spread = ndimage.gaussian_filter(point, SMOOTHING)
    return float(math.fsum((spread**2).ravel()))
