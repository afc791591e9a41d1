"""How a quantity changes with the height: in closed form, with its derivative."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.air.layers import ProfileLayer
from nigemizu.air.standards import standard_breaks, standard_temperature
from nigemizu.air.surface_layer import SurfaceLayer

__all__ = ["Continued", "Course", "Linear", "Near", "Smooth", "Standard", "Summed"]

FloatArray: TypeAlias = NDArray[np.float64]


class Course(ABC):
    """A function of the height that is smooth between its breaks."""

    @abstractmethod
    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Value, and derivative per metre, at heights [m]; at a break the derivative above it."""

    @property
    @abstractmethod
    def breaks(self) -> FloatArray:
        """Heights [m] at which a derivative jumps."""

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        """(height, extent) [m] around which the course has to be looked at closely."""
        return ()


@final
class Standard(Course):
    """Temperature of the standard atmosphere [K], warmer below by an offset that fades to the tropopause."""

    def __init__(self, offset: float = 0.0) -> None:
        self._offset = offset
        self._tropopause = float(standard_breaks()[0])

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        value, slope = standard_temperature(height)
        below = height < self._tropopause
        left = np.where(below, 1 - height / self._tropopause, 0.0)
        return value + self._offset * left, slope - np.where(below, self._offset / self._tropopause, 0.0)

    @property
    def breaks(self) -> FloatArray:
        return standard_breaks()


@final
class Linear(Course):
    """Straight lines through points, their corners rounded over a length.

    Parameters
    ----------
    heights, values : (n,) float64, m and any
    rounding : float, m
        Full width of the kernel 15/16 (1 − u²)² with which the lines are convolved; 0 leaves the corners.

    Notes
    -----
    Lines are a sum of ramps, which the kernel turns into w/2 r(u), r = (5 + 16u + 15u² − 5u⁴ + u⁶)/32,
    u = 2(h − hᵢ)/w from −1 to 1: twice differentiable. The last lines go on beyond the ends.
    """

    def __init__(self, heights: FloatArray, values: FloatArray, rounding: float = 0.0) -> None:
        self._corners = heights[1:-1]
        slopes = np.diff(values) / np.diff(heights)
        self._first = float(heights[0]), float(values[0]), float(slopes[0])
        self._jumps = np.diff(slopes)
        self._half = rounding / 2

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        start, value, slope = self._first
        values = value + slope * (height - start)
        slopes = np.full_like(height, slope)
        for corner, jump in zip(self._corners, self._jumps, strict=True):
            beyond = height - corner
            if self._half == 0:
                values += jump * np.maximum(beyond, 0)
                slopes += jump * (beyond >= 0)
                continue
            u = np.clip(beyond / self._half, -1, 1)
            ramp = (5 + u * (16 + u * (15 + u**2 * (-5 + u**2)))) / 32
            values += jump * (self._half * ramp + np.maximum(beyond - self._half, 0))
            slopes += jump * (8 + u * (15 + u**2 * (-10 + 3 * u**2))) / 16
        return values, slopes

    @property
    def breaks(self) -> FloatArray:
        if self._half == 0:
            return self._corners
        return np.concatenate([self._corners - self._half, self._corners + self._half])

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        return tuple((float(corner), self._half) for corner in self._corners if self._half > 0)


@final
class Smooth(Course):
    """Cubics through points with a continuous slope and no extremes of their own (Fritsch and Carlson).

    References
    ----------
    F. N. Fritsch, R. E. Carlson (1980), Monotone piecewise cubic interpolation, SIAM Journal on Numerical
    Analysis 17, 238–246, doi:10.1137/0717021; the slopes are those of F. N. Fritsch, J. Butland (1984),
    doi:10.1137/0905021.
    """

    def __init__(self, heights: FloatArray, values: FloatArray) -> None:
        self._heights, self._values = heights, values
        widths, secants = np.diff(heights), np.diff(values) / np.diff(heights)
        slopes = np.empty_like(values)
        same = secants[:-1] * secants[1:] > 0
        first, second = 2 * widths[1:] + widths[:-1], widths[1:] + 2 * widths[:-1]
        left, right = (np.where(same, part, 1.0) for part in (secants[:-1], secants[1:]))
        slopes[1:-1] = np.where(same, (first + second) / (first / left + second / right), 0.0)
        slopes[0], slopes[-1] = secants[0], secants[-1]
        self._slopes = slopes

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        heights, values, slopes = self._heights, self._values, self._slopes
        cell = np.clip(np.searchsorted(heights, height, side="right") - 1, 0, len(heights) - 2)
        width = heights[cell + 1] - heights[cell]
        # Beyond the ends the value stays.
        w = np.clip((height - heights[cell]) / width, 0, 1)
        begin, end = slopes[cell] * width, slopes[cell + 1] * width
        rise = values[cell + 1] - values[cell]
        c2, c3 = 3 * rise - 2 * begin - end, begin + end - 2 * rise
        value = values[cell] + w * (begin + w * (c2 + w * c3))
        slope = (begin + w * (2 * c2 + w * 3 * c3)) / width
        return value, np.where((height < heights[0]) | (height > heights[-1]), 0.0, slope)

    @property
    def breaks(self) -> FloatArray:
        return self._heights


@final
class Continued(Course):
    """A course up to a height, and another one above, to which it fades over a length.

    Above the height h₀ it is other(h) + (one(h₀) − other(h₀)) exp(−(h − h₀)/fading); with `other` None the
    value of h₀ stays.
    """

    def __init__(self, one: Course, until: float, other: Course | None, fading: float) -> None:
        self._one, self._until, self._other, self._fading = one, until, other, fading
        end = np.array([until])
        self._end = float(one.value_and_slope(end)[0][0])
        self._apart = 0.0 if other is None else self._end - float(other.value_and_slope(end)[0][0])

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        below = height < self._until
        value, slope = self._one.value_and_slope(np.minimum(height, self._until))
        if self._other is None:
            return np.where(below, value, self._end), np.where(below, slope, 0.0)
        above, rise = self._other.value_and_slope(np.maximum(height, self._until))
        apart = self._apart * np.exp(-np.maximum(height - self._until, 0) / self._fading)
        return np.where(below, value, above + apart), np.where(below, slope, rise - apart / self._fading)

    @property
    def breaks(self) -> FloatArray:
        lower = self._one.breaks
        upper = np.array([]) if self._other is None else self._other.breaks
        return np.concatenate([lower[lower < self._until], [self._until], upper[upper > self._until]])

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        return self._one.scales


@final
class Near(Course):
    """A course with a surface layer at the ground that has its own temperature.

    Notes
    -----
    What the layer departs from the well-mixed air above it is added, and the course itself is shifted, by a
    difference that fades over `fading` [m], so that the air has the layer's temperature where that is told.
    """

    def __init__(self, course: Course, layer: SurfaceLayer, fading: float) -> None:
        self._course, self._layer, self._fading = course, layer, fading
        told = np.array([layer.air_height])
        there = float(course.value_and_slope(told)[0][0] + layer.departure(told)[0])
        self._shift = (layer.air_temperature - there) * np.exp(layer.air_height / fading)

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        value, slope = self._course.value_and_slope(height)
        shift = self._shift * np.exp(-height / self._fading)
        # Pieces of logarithms have no short derivative: a difference over a ten-thousandth of the height.
        step = 1e-4 * np.maximum(height, self._layer.sublayer_top / 2)
        up, down = self._layer.departure(height + step), self._layer.departure(np.maximum(height - step, 0.0))
        rise = (up - down) / (height + step - np.maximum(height - step, 0.0))
        return value + shift + self._layer.departure(height), slope - shift / self._fading + rise

    @property
    def breaks(self) -> FloatArray:
        own = [self._layer.sublayer_top, self._layer.blending_height or np.inf]
        return np.unique(np.concatenate([self._course.breaks, own]))

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        steps = self._layer.sublayer_top * 2.0 ** np.arange(0, 16)
        return (*self._course.scales, *((float(step), float(step) / 6) for step in steps))


@final
class Summed(Course):
    """A course with layers on top."""

    def __init__(self, course: Course, layers: Sequence[ProfileLayer]) -> None:
        self._course, self._layers = course, tuple(layers)

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        value, slope = self._course.value_and_slope(height)
        for layer in self._layers:
            more, rise = layer.value_and_slope(height)
            value, slope = value + more, slope + rise
        return value, slope

    @property
    def breaks(self) -> FloatArray:
        return self._course.breaks

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        return (*self._course.scales, *(scale for layer in self._layers for scale in layer.scales))
