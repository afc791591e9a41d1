"""Moments of displacements, gathered frame by frame: what is kept does not grow with the film."""

from __future__ import annotations

from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Moments"]

FloatArray: TypeAlias = NDArray[np.float64]

_LONGEST: Final = 256  # frames


@final
class Moments:
    """Covariances between tiles, autocovariances and spectra of each tile.

    Parameters
    ----------
    count : int
        Number of tiles M.
    frames : int
        Number of frames that will come.

    Attributes
    ----------
    lags : int
        Largest lag of the autocovariances, in frames: a quarter of the film, 256 at most.
    segment : int
        Frames in each of the half-overlapping pieces of which the spectrum is the mean.

    Notes
    -----
    A tile that was not found in a frame is left out of its sums; a spectrum takes its mean so far instead.
    Room: two M×M matrices for either axis and 2 × 256 displacements of all tiles.
    """

    def __init__(self, count: int, frames: int) -> None:
        self.lags: Final = max(1, min(_LONGEST, frames // 4))
        self.segment: Final = max(8, 2 ** int(np.log2(max(8, min(_LONGEST, frames // 4)))))
        self.frames = 0
        self.pairs = np.zeros((count, count))
        self._sum = np.zeros((2, count, count))
        self._product = np.zeros((2, count, count))
        self._noise = np.zeros((count, 2))
        self._lagged = np.zeros((self.lags + 1, count, 2))
        self._lagged_pairs = np.zeros((self.lags + 1, count))
        self._ring = np.zeros((self.lags + 1, count, 2))
        self._ring_found = np.zeros((self.lags + 1, count))
        self._recent = np.zeros((self.segment, count, 2))
        self._power = np.zeros((self.segment // 2 + 1, count, 2))
        self._pieces = 0

    def take(self, value: FloatArray, noise: FloatArray, found: NDArray[np.bool_]) -> None:
        """Add a frame: displacements (M, 2), their noise variances (M, 2), and which tiles were found."""
        weight = found.astype(np.float64)
        x = np.where(found[:, None], value, 0.0)
        self.pairs += np.outer(weight, weight)
        for axis in range(2):
            self._sum[axis] += np.outer(x[:, axis], weight)
            self._product[axis] += np.outer(x[:, axis], x[:, axis])
        self._noise += np.where(found[:, None], noise, 0.0)
        slot = self.frames % (self.lags + 1)
        self._ring[slot], self._ring_found[slot] = x, weight
        age = (slot - np.arange(self.lags + 1)) % (self.lags + 1)
        self._lagged[age] += self._ring * x
        self._lagged_pairs[age] += self._ring_found * weight
        self._add_to_spectrum(x, found)
        self.frames += 1

    def _add_to_spectrum(self, x: FloatArray, found: NDArray[np.bool_]) -> None:
        self._recent[self.frames % self.segment] = np.where(found[:, None], x, self.mean)
        seen = self.frames + 1
        if seen < self.segment or seen % (self.segment // 2):
            return
        piece = np.roll(self._recent, -(seen % self.segment), axis=0)
        window = np.hanning(self.segment + 1)[:-1, None, None]
        spectrum = np.fft.rfft((piece - piece.mean(0)) * window, axis=0)
        self._power += np.abs(spectrum) ** 2 / (window**2).sum()
        self._pieces += 1

    @property
    def found(self) -> FloatArray:
        """Frames in which each tile was found (M,)."""
        return np.asarray(np.diagonal(self.pairs))

    @property
    def mean(self) -> FloatArray:
        """Mean displacement (M, 2) [pixels]."""
        sums = np.diagonal(self._sum, axis1=1, axis2=2).T
        return np.asarray(sums / np.maximum(self.found, 1.0)[:, None])

    @property
    def noise(self) -> FloatArray:
        """Variance of the noise of the displacements (M, 2) [pixels²]."""
        return np.asarray(self._noise / np.maximum(self.found, 1.0)[:, None])

    def covariance(self, axis: int) -> FloatArray:
        """Covariances (M, M) [pixels²] of the displacements along x (0) or y (1), noise included."""
        pairs = np.maximum(self.pairs, 1.0)
        one = self._sum[axis] / pairs
        return np.asarray(self._product[axis] / pairs - one * one.T)

    def autocovariance(self) -> FloatArray:
        """(lags + 1, M, 2) [pixels²], noise included at lag 0."""
        pairs = np.maximum(self._lagged_pairs, 1.0)[..., None]
        return np.asarray(self._lagged / pairs - self.mean**2)

    def spectrum(self) -> FloatArray:
        """Two-sided power (segment // 2 + 1, M, 2) [pixels² frames] at k/segment cycles per frame."""
        return np.asarray(self._power / max(self._pieces, 1))
