"""Rays of one eye through air over a round Earth: where they turn, and what is summed along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.trace._check import number, numbers
from nigemizu.trace.quadrature import Arcs, Measure, over_elevation, over_height, solve_climb
from nigemizu.trace.shells import RadialIndex, Shells, SphericalAir, arranged

__all__ = ["Fan", "Setting", "wave_shape"]

FloatArray: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]

_MOST: Final = 150_000  # numbers in an array that is worked on
_MOST_SQUARES: Final = 4_000_000  # numbers in an array that is kept
_STEEP: Final = 2.0
"""Shells in which sin² of the elevation grows by less than this factor are integrated over the height."""

_GRAZING: Final = 16.0 * np.finfo(float).eps


@final
@dataclass(frozen=True)
class Fan:
    """What rays sum up on their way from the eye out of the air.

    Attributes
    ----------
    sums : (M, N, K) float64
        One row per measure; NaN for rays that do not leave the air.
    lowest : (N, K) float64, m
        Least height of the ray; NaN likewise.
    exit_sine2, exit_cosine2 : (N, K) float64, 1
        Squares of the sine and cosine of the elevation with which the ray leaves the air; NaN likewise.
    hit, trapped : (N, K) bool
    """

    sums: FloatArray
    lowest: FloatArray
    exit_sine2: FloatArray
    exit_cosine2: FloatArray
    hit: Mask
    trapped: Mask


@final
@dataclass(frozen=True)
class Setting:
    """An index, a sphere and an eye, once checked.

    Attributes
    ----------
    air : SphericalAir
    shells : Shells
    waves : tuple of int
        ``()`` for an index of one wavelength, ``(K,)`` for one of K.
    """

    air: SphericalAir
    shells: Shells
    waves: tuple[int, ...]

    @classmethod
    def of(
        cls,
        index: RadialIndex,
        *,
        radius: float,
        eye: float,
        ground: float,
        top: float | None,
        breaks: ArrayLike | None,
    ) -> Setting:
        """Check what a caller gave.

        Raises
        ------
        InputError
            As the public functions say.
        """
        radius = number(radius, "radius", "metres above 0 (the mean Earth has 6371e3)", above=0.0)
        ground = number(ground, "ground", "metres above the centre of the sphere", above=-radius)
        highest = getattr(index, "top", None) if top is None else top
        if highest is None:
            raise InputError(
                "nothing says where the air ends",
                key="top",
                expected="a height in metres (86e3 for the US Standard Atmosphere)",
            )
        highest = number(highest, "top", f"metres above the ground at {ground:g}", above=ground)
        eye = number(eye, "observer_height", f"metres from {ground:g} to below {highest:g}")
        if not ground <= eye < highest:
            raise InputError(
                "the observer is not in the air",
                key="observer_height",
                value=eye,
                expected=f"metres from the ground at {ground:g} to below the top at {highest:g}",
            )
        given = getattr(index, "breaks", ()) if breaks is None else breaks
        cuts = numbers(given, "breaks", "heights in metres").ravel()
        waves = wave_shape(index, eye)
        air = SphericalAir(index, radius)
        return cls(air, arranged(air, eye, ground=ground, top=highest, breaks=cuts), waves)

    def fan(self, elevation: FloatArray, measures: Sequence[Measure]) -> Fan:
        """What rays of apparent elevations (N,) [rad] sum up."""
        levels, count = self.shells.heights.shape
        length = max(1, min(_MOST // (15 * count), _MOST_SQUARES // (levels * count)))
        parts = [
            self._part(elevation[begin : begin + length], measures)
            for begin in range(0, max(1, len(elevation)), length)
        ]
        others = ("lowest", "exit_sine2", "exit_cosine2", "hit", "trapped")
        return Fan(
            np.concatenate([part.sums for part in parts], axis=1),
            *(np.concatenate([getattr(part, name) for part in parts]) for name in others),
        )

    def _part(self, elevation: FloatArray, measures: Sequence[Measure]) -> Fan:
        eye, shells = self.shells.eye, self.shells
        fan = _Squares.at(elevation, shells)
        trapped = np.any(fan.sine2[:, eye + 1 :] <= 0.0, axis=1)
        falls = elevation[:, None] < 0.0
        below = fan.sine2[:, :eye]
        slack = _GRAZING * (fan.sine2[:, eye] + np.abs(np.expm1(-2.0 * shells.climbs[0])))
        turned = below <= 0.0
        turned[:, :1] |= below[:, :1] <= slack[:, None]
        hit = falls & ~np.any(turned, axis=1)
        lost = trapped | hit
        # of rays that never get out, the sums are taken straight up, and thrown away
        fan = _Squares(np.where(lost[:, None], 1.0, fan.sine2), np.where(lost[:, None], 0.0, fan.cosine2))
        falls = falls & ~lost
        lowest = self._lowest(elevation, turned, falls)
        sums = np.zeros((len(measures), *lost.shape))
        arcs: list[Arcs] = []
        for layer in range(len(shells.ducted)):
            if layer >= eye:
                entering, weight = np.ones_like(lost), 1.0
            else:
                entering, weight = falls & (lowest < shells.heights[layer + 1]), 2.0
            rows = np.flatnonzero(np.any(entering, axis=1))
            if rows.size:
                self._cross(layer, rows, entering[rows], lowest[rows], fan, weight, measures, sums, arcs)
        if arcs:
            over_elevation(self.air, measures, Arcs.joined(arcs), sums)
        sums[:, lost] = np.nan
        lowest, sine2, cosine2 = (
            np.where(lost, np.nan, part) for part in (lowest, fan.sine2[:, -1], fan.cosine2[:, -1])
        )
        return Fan(sums, lowest, sine2, cosine2, hit, trapped & ~hit)

    def _lowest(self, elevation: FloatArray, turned: Mask, falls: Mask) -> FloatArray:
        """Least heights (N, K): the eye's, or where rays that fall turn."""
        eye, shells = self.shells.eye, self.shells
        at_eye = np.full(falls.shape, shells.heights[eye, 0])
        if not np.any(falls):
            return at_eye
        layer = eye - 1 - np.argmax(turned[:, ::-1], axis=1)
        low = np.where(falls, np.take_along_axis(shells.heights, layer, axis=0), at_eye)
        high = np.where(falls, np.take_along_axis(shells.heights, layer + 1, axis=0), at_eye)
        target = 0.5 * np.log1p(-(np.where(falls, np.sin(elevation[:, None]), 0.0) ** 2))
        bottom = np.where(falls, np.take_along_axis(shells.climbs, layer, axis=0), 0.0)
        there = self.air.state(at_eye[:1])[0]
        found, _, _ = solve_climb(self.air, np.maximum(target, bottom), at_eye[:1], there, low, high)
        return np.where(target <= bottom, low, found)

    def _cross(
        self,
        layer: int,
        rows: NDArray[np.intp],
        entering: Mask,
        lowest: FloatArray,
        fan: _Squares,
        weight: float,
        measures: Sequence[Measure],
        sums: FloatArray,
        arcs: list[Arcs],
    ) -> None:
        """Sum over one shell, or put it off as arcs."""
        low, high = self.shells.heights[layer], self.shells.heights[layer + 1]
        sine2, cosine2 = fan.sine2[rows, layer], fan.cosine2[rows, layer]
        sine2_end, cosine2_end = fan.sine2[rows, layer + 1], fan.cosine2[rows, layer + 1]
        whole = (
            np.ones(len(rows), dtype=bool) if weight == 1.0 else np.all(entering & (lowest <= low), axis=1)
        )
        ducted = bool(self.shells.ducted[layer])
        by_height = whole & (ducted | np.all(sine2_end <= _STEEP * sine2, axis=1))
        if np.any(by_height):
            falling = self.shells.climbs[layer + 1, 0] < self.shells.climbs[layer, 0]
            sums[:, rows[by_height]] += weight * over_height(
                self.air,
                measures,
                low=low[None],
                high=high[None],
                sine2=sine2[by_height],
                cosine2=cosine2[by_height],
                level_end=("high" if falling else "low") if ducted else "",
            )
        rest = ~by_height
        if not np.any(rest):
            return
        turns = entering & (lowest > low) if weight == 2.0 else np.zeros_like(entering)
        outside = ~entering
        start = np.where(outside, high, np.where(turns, lowest, low))[rest]
        sine2 = np.where(outside, sine2_end, np.where(turns, 0.0, sine2))[rest]
        cosine2 = np.where(outside, cosine2_end, np.where(turns, 1.0, cosine2))[rest]
        ends = np.broadcast_to(high, start.shape)
        if ducted:
            sums[:, rows[rest]] += weight * over_height(
                self.air, measures, low=start, high=ends, sine2=sine2, cosine2=cosine2, level_end="low"
            )
            return
        angle, angle_end = (
            np.arctan2(np.sqrt(np.maximum(s, 0.0)), np.sqrt(c))
            for s, c in ((sine2, cosine2), (sine2_end[rest], cosine2_end[rest]))
        )
        angle = np.where(outside[rest], angle_end, angle)
        arcs.append(Arcs(rows[rest], np.full(len(start), weight), angle, angle_end, start, ends))


@final
@dataclass(frozen=True)
class _Squares:
    """Squares (N, L, K) of the sine and cosine of the elevation of N rays at L levels.

    Where sin² < 0 a level is out of reach.
    """

    sine2: FloatArray
    cosine2: FloatArray

    @classmethod
    def at(cls, elevation: FloatArray, shells: Shells) -> _Squares:
        loss = np.expm1(-2.0 * shells.climbs)
        sine, cosine = np.sin(elevation)[:, None, None], np.cos(elevation)[:, None, None]
        return cls(sine**2 - cosine**2 * loss, cosine**2 * (1.0 + loss))


def wave_shape(index: RadialIndex, height: float) -> tuple[int, ...]:
    """``()`` for an index of one wavelength, ``(K,)`` for one of K, by its answer for one height [m]."""
    parts = index(np.asarray(height, dtype=np.float64))
    if not isinstance(parts, tuple) or len(parts) != 2:
        raise InputError(
            "the index must return a pair", key="index", value=parts, expected="(n - 1, dn/dh) at heights"
        )
    shape = np.broadcast_shapes(*(np.shape(part) for part in parts))
    if len(shape) > 1:
        raise InputError(
            f"at one height the index returns an array of shape {shape}",
            key="index",
            expected="a number, or one per wavelength",
        )
    return shape
