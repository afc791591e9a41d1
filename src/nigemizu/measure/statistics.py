"""How certain a variance is that was measured over frames and tiles which resemble each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

__all__ = ["Correlation", "Interval", "correlation_of", "quadratic"]

FloatArray: TypeAlias = NDArray[np.float64]

LEVEL: Final = 0.95
_WINDOW: Final = 6.0  # correlation times over which an autocorrelation is summed


@final
@dataclass(frozen=True)
class Interval:
    """A value with the ends of its 95 % interval, noise taken off.

    Attributes
    ----------
    value, low, high : float
    freedom : float
        Degrees of freedom of the χ² law behind the interval.
    """

    value: float
    low: float
    high: float
    freedom: float

    def scaled(self, factor: float) -> Interval:
        """The same in another unit."""
        return Interval(factor * self.value, factor * self.low, factor * self.high, self.freedom)


@final
@dataclass(frozen=True)
class Correlation:
    """How long displacements remember.

    Attributes
    ----------
    values : (K,) float64
        Autocorrelation at lags 0, 1, … frames, without the noise.
    time : float, frames
        Σ ρ over positive and negative lags, as far as it counts: N over it is the number of independent
        frames for a mean.
    squared : float, frames
        Σ ρ², noise included: the same for a variance.
    complete : bool
        Whether the autocorrelation has died down within the lags that were kept.
    """

    values: FloatArray
    time: float
    squared: float
    complete: bool


def correlation_of(autocovariance: FloatArray, noise: float, frames: int) -> Correlation:
    """Correlation from an autocovariance (K,), whose lag 0 has `noise` in it.

    Notes
    -----
    The sums end where ρ first falls to 0, or is no longer told from it, and at 6 Σρ frames at the latest:
    farther out there is only chance. Each ρ² is relieved of the 1/N that chance adds.
    """
    total = float(autocovariance[0])
    signal = total - noise
    if total <= 0.0:
        return Correlation(np.zeros_like(autocovariance), 1.0, 1.0, True)
    time, last, complete = 1.0, 0, True
    for _ in range(4):
        # the mean of the film was taken off, and with it its own variance of C(0) Σρ / N at every lag
        raw = (autocovariance / total + min(time / frames, 0.5)) / (1 + min(time / frames, 0.5))
        time, last, complete = _summed(raw, frames)
    squared = 1.0 + 2 * float(np.maximum(raw[1 : last + 1] ** 2 - 1 / frames, 0.0).sum())
    clean = autocovariance / signal if signal > 0 else np.zeros_like(autocovariance)
    values = np.concatenate([[1.0 if signal > 0 else 0.0], clean[1:]])
    return Correlation(np.clip(values, -1.5, 1.5), time, squared, complete)


def _summed(raw: FloatArray, frames: int) -> tuple[float, int, bool]:
    """Σ ρ over both signs, the last lag in it, and whether there was an end."""
    time = 1.0
    for lag in range(1, raw.size):
        # what is not told from 0 at two standard deviations ends the sums too
        nothing = raw[lag] < 2 / np.sqrt(frames) and lag >= 2 * time
        if raw[lag] <= 0.0 or nothing or lag >= _WINDOW * time:
            return time, lag - 1, True
        time += 2 * float(raw[lag])
    return time, raw.size - 1, raw.size == 1


def quadratic(weights: FloatArray, covariance: FloatArray, noise: FloatArray, frames: float,
              correlation: Correlation) -> Interval:  # fmt: skip
    """tr(W C) less noise, with its interval.

    Parameters
    ----------
    weights : (M, M) float64
        W, symmetric: 1/M on the diagonal for the mean variance of the tiles.
    covariance : (M, M) float64
        C as measured over the frames, noise included.
    noise : (M,) float64
        Variance of the noise of each tile, independent from tile to tile.
    frames : float
        How many.
    correlation : Correlation

    Notes
    -----
    For Gaussian displacements whose correlations in time and between tiles factorise, tr(W C) has the
    variance 2 tr(WCWC)/ν, ν = N / Σ ρ²; tr(WCWC) itself is relieved of what chance adds to it (moments of a
    Wishart matrix). The interval is that of a χ² law with the same mean and variance. The mean that is taken
    off costs 1/n of the variance, n = N / Σ ρ, which is given back.

    Limits: the noise that is taken off counts as known; displacements that are not Gaussian, as gusts make
    them, vary more than this says.
    """
    nu = max(frames / correlation.squared - 1.0, 1.0)
    raw = float(np.sum(weights * covariance))
    product = weights @ covariance
    chance = (float(np.sum(product * product.T)) - raw**2 / nu) / (1 + 1 / nu - 2 / nu**2 if nu > 1 else 1.0)
    # between one tile alone, and tiles that know nothing of each other
    rank = max(int(np.count_nonzero(np.abs(np.diagonal(weights)) > 0)), 1)
    freedom = nu * float(np.clip(raw**2 / chance if chance > 0 else rank, 1.0, rank))
    lost = 1.0 / (1.0 - min(correlation.time / frames, 0.5))
    ends = [float(chi2.ppf(share, freedom)) for share in ((1 + LEVEL) / 2, (1 - LEVEL) / 2)]
    off = float(np.diagonal(weights) @ noise)
    value, low, high = (lost * raw * factor - off for factor in (1.0, freedom / ends[0], freedom / ends[1]))
    return Interval(value, low, high, freedom)
