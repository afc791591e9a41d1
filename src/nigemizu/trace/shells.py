"""Air whose index depends on the height over a round Earth, cut where a ray can turn or its law changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError

__all__ = ["RadialIndex", "Shells", "SphericalAir", "arranged"]

FloatArray: TypeAlias = NDArray[np.float64]

DUCT: Final = 0.05
"""Layers in which 1 + (r/n) dn/dr falls below this are integrated over the height instead of the angle."""

_SAMPLES: Final = 33
_PLACES: Final = -np.cos(np.linspace(0.0, np.pi, _SAMPLES))  # on [−1, 1]
_INTEGRAL: Final = np.polynomial.chebyshev.chebvander(_PLACES, _SAMPLES) @ np.polynomial.chebyshev.chebint(
    np.linalg.inv(np.polynomial.chebyshev.chebvander(_PLACES, _SAMPLES - 1)), lbnd=-1, axis=0
)
"""(33, 33): from values on the places to the integrals of their polynomial from −1 to the places."""

_FINEST: Final = 1e-13  # by which n may differ from the integral of its slope
_CLOSE: Final = 1e-6  # the same in terms of the change of n in the layer
_THINNEST: Final = 1e-4  # m; layers that are halved no more
_MOST_LAYERS: Final = 5000
_SAME: Final = 1e-6  # m; between breaks that count as one
_JUMP: Final = 1e-10  # of n at a break: a horizontal ray turns by √(2e-10) there


class RadialIndex(Protocol):
    """Refractive index as a function of the height: ``index(height)`` returns (n − 1, dn/dh).

    Heights come as an array of float64 [m]; both results broadcast with it: (n − 1) [1], dn/dh [m⁻¹]. For K
    wavelengths the last axis of the results is theirs, and heights come with a last axis of length 1 or K.
    Heights at which dn/dh jumps may stand in an attribute ``breaks`` [m], the height at which the air ends
    in an attribute ``top`` [m].
    """

    def __call__(self, height: FloatArray, /) -> tuple[ArrayLike, ArrayLike]:
        """n − 1 and dn/dh [m⁻¹] at heights [m]."""


@final
@dataclass(frozen=True)
class SphericalAir:
    """An index over a sphere.

    Attributes
    ----------
    index : RadialIndex
    radius : float, m
        Of the sphere at height 0.
    """

    index: RadialIndex
    radius: float

    def state(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """n − 1 and dn/dh [m⁻¹], in the shape of the heights (..., 1 or K) with all K wavelengths."""
        excess, slope = (np.asarray(part, dtype=np.float64) for part in self.index(height))
        shape = np.broadcast_shapes(height.shape, excess.shape, slope.shape)
        return np.broadcast_to(excess, shape), np.broadcast_to(slope, shape)

    def climb(
        self, height: FloatArray, excess: FloatArray, from_: FloatArray, there: FloatArray
    ) -> FloatArray:
        """ln(n r) at `height`, where n − 1 is `excess`, less ln(n r) at `from_`, where n − 1 is `there`."""
        return np.asarray(
            np.log1p((excess - there) / (1.0 + there)) + np.log1p((height - from_) / (self.radius + from_))
        )

    def rate(self, height: FloatArray, excess: FloatArray, slope: FloatArray) -> FloatArray:
        """d ln(n r)/dr [m⁻¹]."""
        return np.asarray(1.0 / (self.radius + height) + slope / (1.0 + excess))


@final
@dataclass(frozen=True)
class Shells:
    """Levels between which ln(n r) is smooth and monotonic, and d n/dh is smooth.

    Attributes
    ----------
    heights : (L, K) float64, m
        From the ground to the top of the air.
    climbs : (L, K) float64, 1
        ln(n r) there, less its value at the eye.
    ducted : (L − 1,) bool
        Whether n r hardly grows, or falls, somewhere between a level and the next.
    eye : int
        Which level the eye is at.
    """

    heights: FloatArray
    climbs: FloatArray
    ducted: NDArray[np.bool_]
    eye: int


def arranged(air: SphericalAir, eye: float, *, ground: float, top: float, breaks: FloatArray) -> Shells:
    """The shells of an air, seen by an eye at a height.

    Raises
    ------
    InputError
        The index is not finite, jumps at a break, or its derivative is not that of the index.
    """
    fixed = np.unique([ground, eye, top])
    inner = np.unique(breaks[(breaks > ground) & (breaks < top)])
    inner = inner[np.abs(inner[:, None] - fixed).min(axis=1) > _SAME]
    inner = inner[np.diff(inner, prepend=-np.inf) > _SAME]
    cuts = np.sort(np.concatenate([fixed, inner]))
    levels, samples, excess, slope = _resolved(air, cuts)
    rates = air.rate(samples[..., None], excess, slope) * (air.radius + samples[..., None])
    ducted = rates.min(axis=(1, 2)) < DUCT
    heights, flags = np.repeat(levels[:, None], excess.shape[-1], axis=1), ducted
    if np.any(ducted):
        heights, flags = _with_stationary(air, levels, samples, rates, ducted)
    at_eye = np.full((1, heights.shape[1]), eye)
    climbs = air.climb(heights, air.state(heights)[0], at_eye, air.state(at_eye)[0])
    place = int(np.flatnonzero(np.all(heights == eye, axis=1))[0])
    return Shells(heights, climbs, flags, place)


def _resolved(air: SphericalAir, cuts: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Levels (L,), with as many added to the cuts as it takes for samples to know n and dn/dh between them.

    Also the samples (L − 1, 33), and n − 1 and dn/dh there (L − 1, 33, K). Wherever the integral of the
    polynomial through the samples of dn/dh does not give the samples of n, a layer is halved.
    """
    low, high = cuts[:-1], cuts[1:]
    kept = []
    count = len(low)
    while len(low):
        samples = _between(low, high)
        excess, slope = air.state(samples[..., None])
        _check_finite(samples, excess, slope)
        reach = 0.5 * (samples[:, -1] - samples[:, 0])
        foretold = reach[:, None, None] * np.einsum("ij,ljk->lik", _INTEGRAL, slope)
        amount = reach[:, None] * np.abs(slope).mean(axis=1) * 2.0
        apart = np.abs(excess - excess[:, :1] - foretold).max(axis=1)
        thin = (high - low < _THINNEST)[:, None]
        coarse = np.any(apart > np.where(thin, _JUMP, _FINEST + _CLOSE * amount), axis=1)
        kept += list(zip(low[~coarse], samples[~coarse], excess[~coarse], slope[~coarse], strict=True))
        count += int(coarse.sum())
        low, high = low[coarse], high[coarse]
        if count > _MOST_LAYERS or np.any(thin[coarse]):
            _refuse_slope(low, high, apart[coarse].max(axis=1))
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    kept.sort(key=lambda layer: float(layer[0]))
    starts, samples, excess, slope = (np.array(part) for part in zip(*kept, strict=True))
    _check_joints(starts, samples, excess, slope)
    return np.append(starts, cuts[-1]), samples, excess, slope


def _between(low: FloatArray, high: FloatArray) -> FloatArray:
    """Sample heights (L, 33) just inside each pair of levels, denser towards both."""
    inset = 1e-9 * (high - low) + 4.0 * np.spacing(np.maximum(np.abs(low), np.abs(high)))
    part = 0.5 + 0.5 * _PLACES
    return np.asarray((low + inset)[:, None] + (high - low - 2.0 * inset)[:, None] * part)


def _check_finite(samples: FloatArray, excess: FloatArray, slope: FloatArray) -> None:
    good = np.isfinite(excess) & np.isfinite(slope) & (excess > -1.0)
    if not np.all(good):
        where = np.argwhere(~good)[0]
        raise InputError(
            f"no finite index above 0, or no finite slope, at {samples[where[0], where[1]]:g} m",
            key="index",
            value=float(excess[tuple(where)]),
            expected="n - 1 and dn/dh at every height from the ground to the top",
        )


def _check_joints(starts: FloatArray, samples: FloatArray, excess: FloatArray, slope: FloatArray) -> None:
    gaps = samples[1:, 0] - samples[:-1, -1]
    reach = gaps[:, None] * (np.abs(slope[1:, 0]) + np.abs(slope[:-1, -1]))
    jumps = np.abs(excess[1:, 0] - excess[:-1, -1]) - reach
    if jumps.size and jumps.max() > _JUMP:
        layer = int(np.argmax(jumps.max(axis=-1)))
        raise InputError(
            f"the index jumps at the height {starts[layer + 1]:g} m",
            key="index",
            value=float(jumps[layer].max()),
            expected="a continuous index, whose slope alone may jump",
            remedy="join the layers, or spread the jump over a few centimetres",
        )


def _refuse_slope(low: FloatArray, high: FloatArray, apart: FloatArray) -> None:
    worst = int(np.argmax(apart))
    raise InputError(
        f"dn/dh does not add up to the change of n between {low[worst]:g} and {high[worst]:g} m",
        key="index",
        value=float(apart[worst]),
        expected="the derivative of n - 1 by the height in metres, and a continuous n",
        remedy="give the heights at which dn/dh jumps as breaks",
    )


def _with_stationary(
    air: SphericalAir,
    levels: FloatArray,
    samples: FloatArray,
    rates: FloatArray,
    ducted: NDArray[np.bool_],
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Levels (L, K) with those added at which n r is greatest or least, and the flags of the layers."""
    count = rates.shape[-1]
    rows, flags = [], []
    for layer, duct in enumerate(ducted):
        rows.append(np.full(count, levels[layer]))
        flags.append(bool(duct))
        if not duct:
            continue
        rising = rates[layer] > 0.0
        turns = rising[1:] != rising[:-1]
        for part in np.flatnonzero(turns.any(axis=1)):
            low, high = (np.full(count, samples[layer, part + step]) for step in (0, 1))
            rows.append(_root(air, low, high, rising[part], turns[part]))
            flags.append(True)
    rows.append(np.full(count, levels[-1]))
    return np.array(rows), np.array(flags)


def _root(
    air: SphericalAir, low: FloatArray, high: FloatArray, rising: NDArray[np.bool_], turns: NDArray[np.bool_]
) -> FloatArray:
    """Heights (K,) at which n r turns, by halving; the middle where it does not."""
    middle = 0.5 * (low + high)
    found = middle
    for _ in range(60):
        found = 0.5 * (low + high)
        excess, slope = air.state(found)
        before = (air.rate(found, excess, slope) > 0.0) == rising
        low, high = np.where(before, found, low), np.where(before, high, found)
    return np.where(turns, found, middle)
