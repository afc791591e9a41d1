"""Where the images of a far object fold over: what a curve of heights against elevations holds."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal, NamedTuple, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Fold", "ImageBand", "Shoot", "find_images", "image_count"]

FloatArray: TypeAlias = NDArray[np.float64]

Shoot: TypeAlias = Callable[[FloatArray], FloatArray]
"""Heights [m] at which rays of elevations [rad] come to the target; NaN where they do not."""

_PARTS: Final = 16  # of a bracket, in each round
_ROUNDS: Final = 12
_NARROW: Final = 1e-12  # rad, of a bracket that is halved no more


class Fold(NamedTuple):
    """An elevation at which an erect image and an inverted one meet.

    Attributes
    ----------
    elevation : float, rad
    height : float, m
        What is seen there.
    kind : {"lowest", "highest"}
        Whether the height is the least near there, or the greatest. The lowest is the vanishing line of an
        inferior mirage: what lies below it is not seen.
    """

    elevation: float
    height: float
    kind: Literal["lowest", "highest"]


@final
@dataclass(frozen=True)
class ImageBand:
    """Elevations, in one piece, over which one image is seen.

    Attributes
    ----------
    low, high : float, rad
        Elevations at its edges.
    low_height, high_height : float, m
        What is seen there.
    """

    low: float
    high: float
    low_height: float
    high_height: float

    @property
    def erect(self) -> bool:
        """Whether what is higher is seen higher."""
        return self.high_height >= self.low_height


def find_images(
    shoot: Shoot, elevation: FloatArray, height: FloatArray, *, tolerance: float
) -> tuple[tuple[Fold, ...], tuple[ImageBand, ...]]:
    """Folds and image bands of a curve that is known at some elevations and can be asked at others.

    Parameters
    ----------
    shoot : Shoot
    elevation : (N,) float64, rad
        Increasing.
    height : (N,) float64, m
        What `shoot` answers there.
    tolerance : float, m
        Error of the heights: what differs by less is no fold, and folds are sought no further.

    Returns
    -------
    folds : tuple of Fold
        From below upwards.
    bands : tuple of ImageBand
        From below upwards; they end at folds, and where rays no longer come to the target.

    Notes
    -----
    An edge, where rays begin to come to the target, is closed in on by bisection, in 16 parts a time; a fold,
    where the height is extreme, by the best of as many. Limits: two folds between three neighbouring
    elevations are not found.
    """
    elevation, height = _with_edges(shoot, elevation, height)
    folds = _refined(shoot, *_brackets(elevation, height, tolerance), tolerance)
    return tuple(folds), tuple(_bands(elevation, height, folds))


def image_count(bands: tuple[ImageBand, ...], height: ArrayLike) -> NDArray[np.int64]:
    """How many of the bands show each height [m]; 0 for NaN."""
    heights = np.asarray(height, dtype=np.float64)
    count = np.zeros(heights.shape, dtype=np.int64)
    for band in bands:
        low, high = sorted((band.low_height, band.high_height))
        count += (heights >= low) & (heights <= high)
    return count


def _with_edges(shoot: Shoot, elevation: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The curve with a point added at each edge, just within."""
    reached = np.isfinite(height)
    before = np.flatnonzero(reached[1:] != reached[:-1])
    if not before.size:
        return elevation, height
    inward = np.where(reached[before], before, before + 1)
    outward = np.where(reached[before], before + 1, before)
    inside, there, outside = elevation[inward], height[inward], elevation[outward]
    fractions = np.arange(1, _PARTS) / _PARTS
    for _ in range(_ROUNDS):
        if np.all(np.abs(outside - inside) <= _NARROW):
            break
        tried = inside[:, None] + (outside - inside)[:, None] * fractions
        found = shoot(tried.ravel()).reshape(tried.shape)
        # the first that does not come to the target, and the last before it
        lost = np.append(~np.isfinite(found), np.ones((len(found), 1), dtype=bool), axis=1).argmax(axis=1)
        rows = np.arange(len(found))
        tried = np.column_stack([inside, tried, outside])
        found = np.column_stack([there, found, np.full(len(found), np.nan)])
        inside, there, outside = tried[rows, lost], found[rows, lost], tried[rows, lost + 1]
    merged = np.concatenate([elevation, inside])
    order = np.argsort(merged, kind="stable")
    return merged[order], np.concatenate([height, there])[order]


def _brackets(
    elevation: FloatArray, height: FloatArray, tolerance: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of each fold three elevations (F, 3), the heights there, and +1 for the greatest, −1 for the least."""
    rise = np.diff(height)
    clear = np.flatnonzero(np.abs(rise) > tolerance)  # NaN is not clear
    first, second = clear[:-1], clear[1:]
    # Between two clear pieces the curve may be flat, but must be all there.
    whole = np.array([np.all(np.isfinite(height[a : b + 2])) for a, b in zip(first, second, strict=True)])
    turns = np.flatnonzero(whole.astype(bool) & (rise[first] * rise[second] < 0))
    picked: list[Any] = []
    for turn in turns:
        a, b = int(first[turn]), int(second[turn]) + 1
        sign = 1.0 if rise[a] > 0 else -1.0
        best = a + 1 + int(np.argmax(sign * height[a + 1 : b]))
        picked.append((elevation[[a, best, b]], height[[a, best, b]], sign))
    if not picked:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    places, heights, signs = zip(*picked, strict=True)
    return np.array(places), np.array(heights), np.array(signs)


def _refined(
    shoot: Shoot, places: FloatArray, heights: FloatArray, signs: FloatArray, tolerance: float
) -> list[Fold]:
    fractions = np.arange(1, _PARTS) / _PARTS
    for _ in range(_ROUNDS if len(places) else 0):
        width = places[:, 2] - places[:, 0]
        depth = np.abs(heights[:, 1:2] - heights[:, ::2]).max(axis=1)
        if np.all((width <= _NARROW) | (depth <= tolerance)):
            break
        tried = places[:, :1] + width[:, None] * fractions
        found = shoot(tried.ravel()).reshape(tried.shape)
        tried, found = np.column_stack([tried, places]), np.column_stack([found, heights])
        known = np.where(np.isfinite(found), signs[:, None] * found, -np.inf)
        best = known.argmax(axis=1)[:, None]
        there = np.take_along_axis(tried, best, axis=1)
        left = np.where(tried < there, tried, -np.inf).argmax(axis=1)[:, None]
        right = np.where(tried > there, tried, np.inf).argmin(axis=1)[:, None]
        around = np.concatenate([left, best, right], axis=1)
        places, heights = (np.take_along_axis(part, around, axis=1) for part in (tried, found))
    return [
        Fold(float(place), float(height), "highest" if sign > 0 else "lowest")
        for place, height, sign in zip(places[:, 1], heights[:, 1], signs, strict=True)
    ]


def _bands(elevation: FloatArray, height: FloatArray, folds: list[Fold]) -> list[ImageBand]:
    reached = np.isfinite(height)
    steps = np.diff(np.concatenate([[0], reached.astype(np.int8), [0]]))
    bands = []
    for first, after in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True):
        low, high = elevation[first], elevation[after - 1]
        corners = [
            (low, height[first]),
            *((fold.elevation, fold.height) for fold in folds if low < fold.elevation < high),
            (high, height[after - 1]),
        ]
        bands += [
            ImageBand(float(begin[0]), float(end[0]), float(begin[1]), float(end[1]))
            for begin, end in itertools.pairwise(corners)
            if end[0] > begin[0]
        ]
    return bands
