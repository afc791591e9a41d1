"""How a quantity changes with the height: in closed form, with its derivative."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.air.layers import ProfileLayer
from nigemizu.air.standards import standard_breaks, standard_temperature
from nigemizu.air.surface_layer import Departure, SurfaceLayer

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
    @abstractmethod
    def kinks(self) -> FloatArray:
        """Those of the breaks at which the first derivative jumps."""

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

    @property
    def kinks(self) -> FloatArray:
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
        self._heights, self._values = heights, values
        self._slopes = np.diff(values) / np.diff(heights)
        self._half = rounding / 2

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        corners, jumps, half = self._heights[1:-1], np.diff(self._slopes), self._half
        cell = np.searchsorted(corners, height, side="right")
        slope = self._slopes[cell]
        value = self._values[cell] + slope * (height - self._heights[cell])
        # What rounding adds; where it is wider than the lines are long, of several corners.
        first = np.searchsorted(corners, height - half)
        last = np.searchsorted(corners, height + half)
        for number in range(int(np.max(last - first, initial=0)) if half > 0 else 0):
            corner = np.minimum(first + number, len(corners) - 1)
            jump = np.where(first + number < last, jumps[corner], 0.0)
            u = np.clip((height - corners[corner]) / half, -1, 1)
            ramp = (5 + u * (16 + u * (15 + u**2 * (-5 + u**2)))) / 32
            value = value + jump * half * (ramp - np.maximum(u, 0))
            slope = slope + jump * ((8 + u * (15 + u**2 * (-10 + 3 * u**2))) / 16 - (cell > corner))
        return value, slope

    @property
    def breaks(self) -> FloatArray:
        corners = self._heights[1:-1]
        return corners if self._half == 0 else np.concatenate([corners - self._half, corners + self._half])

    @property
    def kinks(self) -> FloatArray:
        return self._heights[1:-1] if self._half == 0 else np.array([])

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        return tuple((float(corner), self._half) for corner in self._heights[1:-1] if self._half > 0)


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

    @property
    def kinks(self) -> FloatArray:
        return self._heights[[0, -1]]


@final
class Continued(Course):
    """A course up to a height, and another one above, to which it fades over a length.

    Parameters
    ----------
    one : Course
    until : float, m
    other : Course or None
        With None the value at `until` stays.
    fading : float, m
    joining : float, m
        Over which the slope passes from that of the one to that of the other; 0 makes a kink.

    Notes
    -----
    With x = h − until, it is other(h) + A exp(−x/fading) + B x exp(−x/joining), where A and B make value and
    slope continuous.
    """

    def __init__(
        self, one: Course, until: float, other: Course | None, fading: float, joining: float = 0.0
    ) -> None:
        self._one, self._until, self._other = one, until, other
        self._fading, self._joining = fading, joining
        end = np.array([until])
        (value,), (slope,) = one.value_and_slope(end)
        (there,), (rise,) = ((value,), (0.0,)) if other is None else other.value_and_slope(end)
        self._there, self._apart = float(there), float(value - there)
        self._bend = float(slope - rise + self._apart / fading) if joining > 0 else 0.0

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        below = height < self._until
        value, slope = self._one.value_and_slope(np.minimum(height, self._until))
        above, rise = np.full_like(value, self._there), np.zeros_like(value)
        if self._other is not None:
            above, rise = self._other.value_and_slope(np.maximum(height, self._until))
        x = np.maximum(height - self._until, 0)
        apart = self._apart * np.exp(-x / self._fading)
        above, rise = above + apart, rise - apart / self._fading
        if self._joining > 0:
            bend = self._bend * np.exp(-x / self._joining)
            above, rise = above + bend * x, rise + bend * (1 - x / self._joining)
        return np.where(below, value, above), np.where(below, slope, rise)

    @property
    def breaks(self) -> FloatArray:
        return self._put_together("breaks", joins=True)

    @property
    def kinks(self) -> FloatArray:
        return self._put_together("kinks", joins=self._joining == 0)

    def _put_together(self, which: str, *, joins: bool) -> FloatArray:
        lower = getattr(self._one, which)
        upper = np.array([]) if self._other is None else getattr(self._other, which)
        until = [self._until] if joins else []
        return np.concatenate([lower[lower < self._until], until, upper[upper > self._until]])

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        own = ((self._until, self._joining),) if self._joining > 0 else ()
        return (*self._one.scales, *own)


@final
class Near(Course):
    """A course with a surface layer at the ground that has its own temperature.

    Notes
    -----
    What the layer departs from the well-mixed air above it is added, and the course itself is shifted, by a
    difference that fades over `fading` [m], so that the air has the layer's temperature where that is told.
    """

    def __init__(self, course: Course, layer: SurfaceLayer, fading: float) -> None:
        self._course, self._fading = course, fading
        self._departure = Departure.of(layer)
        told = np.array([layer.air_height])
        there = float(course.value_and_slope(told)[0][0] + self._departure(told)[0][0])
        self._shift = (layer.air_temperature - there) * np.exp(layer.air_height / fading)

    def value_and_slope(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        value, slope = self._course.value_and_slope(height)
        shift = self._shift * np.exp(-height / self._fading)
        departure, rise = self._departure(height)
        return value + shift + departure, slope - shift / self._fading + rise

    @property
    def breaks(self) -> FloatArray:
        return np.unique(np.concatenate([self._course.breaks, self._departure.breaks]))

    @property
    def kinks(self) -> FloatArray:
        return self._course.kinks

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        steps = self._departure.breaks[0] * 8.0 ** np.arange(0, 5)
        return (*self._course.scales, *((float(step), float(step) / 3) for step in steps))


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
    def kinks(self) -> FloatArray:
        return self._course.kinks

    @property
    def scales(self) -> tuple[tuple[float, float], ...]:
        return (*self._course.scales, *(scale for layer in self._layers for scale in layer.scales))
