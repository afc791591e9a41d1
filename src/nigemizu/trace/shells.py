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
    inner = breaks[(breaks > ground) & (breaks < top)]
    levels = np.unique(np.concatenate([[ground, eye, top], inner]))
    samples = _between(levels)
    excess, slope = air.state(samples[..., None])
    _check_samples(samples, excess, slope)
    rates = air.rate(samples[..., None], excess, slope) * (air.radius + samples[..., None])
    ducted = rates.min(axis=(1, 2)) < DUCT
    if not np.any(ducted):
        heights = np.repeat(levels[:, None], excess.shape[-1], axis=1)
        flags = ducted
    else:
        heights, flags = _with_stationary(air, levels, samples, rates, ducted)
    at_eye = np.full((1, heights.shape[1]), eye)
    climbs = air.climb(heights, air.state(heights)[0], at_eye, air.state(at_eye)[0])
    place = int(np.flatnonzero(np.all(heights == eye, axis=1))[0])
    return Shells(heights, climbs, flags, place)


def _between(levels: FloatArray) -> FloatArray:
    """Sample heights (L − 1, 33) just inside each pair of levels, denser towards both."""
    low, high = levels[:-1, None], levels[1:, None]
    inset = 1e-9 * (high - low) + 4.0 * np.spacing(np.maximum(np.abs(low), np.abs(high)))
    part = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, _SAMPLES))
    return np.asarray(low + inset + (high - low - 2.0 * inset) * part)


def _check_samples(samples: FloatArray, excess: FloatArray, slope: FloatArray) -> None:
    good = np.isfinite(excess) & np.isfinite(slope) & (excess > -1.0)
    if not np.all(good):
        where = np.argwhere(~good)[0]
        raise InputError(
            f"no finite index above 0, or no finite slope, at {samples[where[0], where[1]]:g} m",
            key="index",
            value=float(excess[tuple(where)]),
            expected="n - 1 and dn/dh at every height from the ground to the top",
        )
    gaps = samples[1:, 0] - samples[:-1, -1]
    reach = gaps[:, None] * (np.abs(slope[1:, 0]) + np.abs(slope[:-1, -1]))
    jumps = np.abs(excess[1:, 0] - excess[:-1, -1]) - reach
    if jumps.size and jumps.max() > _JUMP:
        layer = int(np.argmax(jumps.max(axis=-1)))
        raise InputError(
            f"the index jumps at the height {samples[layer + 1, 0]:g} m",
            key="index",
            value=float(jumps[layer].max()),
            expected="a continuous index, whose slope alone may jump",
            remedy="join the layers, or spread the jump over a few centimetres",
        )
    steps = np.diff(samples, axis=1)[..., None]
    means = 0.5 * (slope[:, 1:] + slope[:, :-1])
    foretold, amount = (steps * means).sum(axis=1), (steps * np.abs(means)).sum(axis=1)
    found = excess[:, -1] - excess[:, 0]
    clear = (np.abs(foretold) > 0.5 * amount) & (amount > _JUMP)
    wrong = clear & ~((found / np.where(clear, foretold, 1.0) > 0.2) & (np.abs(found) < 5.0 * amount))
    wrong |= np.abs(found) > 5.0 * amount + _JUMP
    if np.any(wrong):
        layer = int(np.argwhere(wrong)[0][0])
        raise InputError(
            f"dn/dh does not add up to the change of n between {samples[layer, 0]:g} "
            f"and {samples[layer, -1]:g} m",
            key="index",
            expected="dn/dh per metre, negative where n falls with height",
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
