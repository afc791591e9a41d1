"""Quantities of the ground that vary in time (schedules) and in place (patterns)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, Self, final

import numpy as np
from pydantic import Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from nigemizu.heat.grey import bilinear, read_grey
from nigemizu.heat.grid import Grid
from nigemizu.heat.measures import Degrees, Metres, Seconds
from nigemizu.values import Value

__all__ = ["Daily", "Disc", "Image", "Patches", "Pattern", "Quantity", "Rectangle", "Schedule", "Stripes"]

Interval = tuple[Metres, Metres]


@final
class Schedule(Value):
    """A table in time, linear between its rows and constant before the first and after the last.

    Parameters
    ----------
    times : tuple of float, s
        Increasing.
    values : tuple of float
        In the unit of the quantity.
    """

    times: tuple[Seconds, ...] = Field(min_length=2)
    values: tuple[float, ...] = Field(min_length=2)

    @model_validator(mode="after")
    def _rows(self) -> Self:
        if len(self.times) != len(self.values):
            raise ValueError(f"{len(self.times)} times but {len(self.values)} values")
        if any(b <= a for a, b in zip(self.times, self.times[1:], strict=False)):
            raise ValueError("the times must increase")
        return self

    def at(self, time: float) -> float:
        """Value at `time` [s]."""
        return float(np.interp(time, self.times, self.values))

    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value."""
        return min(self.values), max(self.values)

    def finest(self) -> float:
        """Shortest time between two rows [s]."""
        return float(np.min(np.diff(self.times)))


@final
class Daily(Value):
    """A day's course: a cosine about a mean.

    Parameters
    ----------
    mean, amplitude : float
        In the unit of the quantity.
    time_of_maximum : float, s
        Time at which the highest value is reached.
    period : float, s
        Length of the cycle, a day unless said otherwise.
    """

    mean: float
    amplitude: float = Field(ge=0)
    time_of_maximum: Seconds = 50_400.0
    period: Seconds = Field(default=86_400.0, gt=0)

    def at(self, time: float) -> float:
        """Value at `time` [s]."""
        return self.mean + self.amplitude * math.cos(
            2 * math.pi * (time - self.time_of_maximum) / self.period
        )

    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value."""
        return self.mean - self.amplitude, self.mean + self.amplitude

    def finest(self) -> float:
        """Time that a step should not exceed, so that the course is followed [s]."""
        return self.period / 200


class _Change(Value):
    """What a piece of a pattern does: replaces the value, or shifts it."""

    value: float | None = None
    offset: float | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.value is None) == (self.offset is None):
            raise ValueError("give either value (replaces) or offset (is added)")
        return self


@final
class Rectangle(_Change):
    """A rectangle between `x` and `y` [m] in which the quantity is changed."""

    shape: Literal["rectangle"] = "rectangle"
    x: Interval
    y: Interval

    def covers(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """True where the point lies inside."""
        inside = (x >= self.x[0]) & (x < self.x[1]) & (y >= self.y[0]) & (y < self.y[1])
        return np.asarray(inside)


@final
class Disc(_Change):
    """A disc about `center` [m] with `radius` [m] in which the quantity is changed."""

    shape: Literal["disc"] = "disc"
    center: tuple[Metres, Metres]
    radius: Metres = Field(gt=0)

    def covers(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """True where the point lies inside."""
        return np.asarray(np.hypot(x - self.center[0], y - self.center[1]) < self.radius)


@final
class Patches(Value):
    """Rectangles and discs, laid down in order."""

    kind: Literal["patches"] = "patches"
    patches: tuple[Annotated[Rectangle | Disc, Field(discriminator="shape")], ...] = Field(min_length=1)

    def apply(self, base: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """`base` with the patches laid on it; `base`, `x`, `y` are (ny, nx)."""
        result = base.copy()
        for patch in self.patches:
            inside = patch.covers(x, y)
            result[inside] = (
                patch.value if patch.value is not None else result[inside] + (patch.offset or 0.0)
            )
        return result

    def changes(self) -> Iterator[tuple[bool, float]]:
        """Every change as (replaces?, number)."""
        for patch in self.patches:
            yield patch.value is not None, patch.value if patch.value is not None else patch.offset or 0.0

    def bounds(self, low: float, high: float) -> tuple[float, float]:
        """Numbers between which the quantity stays that stayed between `low` and `high`."""
        for change in self.changes():  # one patch may lie on another: their offsets add up
            low, high = _widened(low, high, [change])
        return low, high


@final
class Stripes(Value):
    """Parallel stripes that take the given values in turn.

    Parameters
    ----------
    direction : float, degrees
        Direction across the stripes, counted from x towards y: 0 alternates along x.
    width : float, m
        Width of one stripe.
    values, offsets : tuple of float
        One of the two: values that replace, or offsets that are added.
    origin : float, m
        Where the first stripe begins along `direction`.
    """

    kind: Literal["stripes"] = "stripes"
    direction: Degrees = 0.0
    width: Metres = Field(gt=0)
    origin: Metres = 0.0
    values: tuple[float, ...] = ()
    offsets: tuple[float, ...] = ()

    @model_validator(mode="after")
    def _one(self) -> Self:
        if bool(self.values) == bool(self.offsets):
            raise ValueError("give either values (replace) or offsets (are added)")
        return self

    def apply(self, base: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """`base` with the stripes laid on it; `base`, `x`, `y` are (ny, nx)."""
        angle = math.radians(self.direction)
        along = x * math.cos(angle) + y * math.sin(angle) - self.origin
        numbers = np.array(self.values or self.offsets)
        chosen = numbers[np.floor(along / self.width).astype(np.int64) % numbers.size]
        return np.asarray(chosen if self.values else base + chosen)

    def changes(self) -> Iterator[tuple[bool, float]]:
        """Every change as (replaces?, number)."""
        for number in self.values or self.offsets:
            yield bool(self.values), number

    def bounds(self, low: float, high: float) -> tuple[float, float]:
        """Numbers between which the quantity stays that stayed between `low` and `high`."""
        return _widened(low, high, self.changes())


@final
class Image(Value):
    """A grey picture as a map: black and white stand for two numbers, grey lies linearly between.

    The picture is seen from above with x to the right and y upwards, and is interpolated linearly.

    Parameters
    ----------
    file : path
        Any picture that Pillow reads; colours become luminance.
    values, offsets : (float, float)
        One of the two: numbers for black and white that replace the quantity, or that are added to it.
    x, y : (float, float), m, optional
        Ends of the picture; the whole grid unless given. Outside it nothing is changed.
    """

    kind: Literal["image"] = "image"
    file: Path
    values: tuple[float, float] | None = None
    offsets: tuple[float, float] | None = None
    x: Interval | None = None
    y: Interval | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.values is None) == (self.offsets is None):
            raise ValueError("give either values (replace) or offsets (are added) for (black, white)")
        return self

    def apply(self, base: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """`base` with the picture laid on it; `base`, `x`, `y` are (ny, nx)."""
        grey = read_grey(self.file)
        x_ends = self.x or _ends(x[0])
        y_ends = self.y or _ends(y[:, 0])
        column = (x - x_ends[0]) / (x_ends[1] - x_ends[0]) * grey.shape[1] - 0.5
        row = (y_ends[1] - y) / (y_ends[1] - y_ends[0]) * grey.shape[0] - 0.5
        inside = (x >= x_ends[0]) & (x <= x_ends[1]) & (y >= y_ends[0]) & (y <= y_ends[1])
        black, white = self.values or self.offsets or (0.0, 0.0)
        mapped = black + (white - black) * bilinear(grey, row, column)
        return np.where(inside, mapped if self.values is not None else base + mapped, base)

    def changes(self) -> Iterator[tuple[bool, float]]:
        """Every change as (replaces?, number)."""
        for number in self.values or self.offsets or ():
            yield self.values is not None, number

    def bounds(self, low: float, high: float) -> tuple[float, float]:
        """Numbers between which the quantity stays that stayed between `low` and `high`."""
        return _widened(low, high, self.changes())


Pattern = Annotated[Patches | Stripes | Image, Field(discriminator="kind")]
"""A change of a quantity in place, told apart by ``kind``."""


@final
class Quantity(Value):
    """A number that may vary in time and in place. A plain number stands for a constant.

    Parameters
    ----------
    value : float, optional
        Constant in time.
    schedule : Schedule, optional
        Table in time.
    daily : Daily, optional
        A day's course.
    patterns : tuple of Pattern
        Changes in place, laid down in order on the value of the time.

    Examples
    --------
    >>> Quantity.model_validate(320).at_time(5.0)
    320.0
    >>> Quantity(schedule=Schedule(times=(0, 10), values=(300, 320))).at_time(5.0)
    310.0
    """

    value: float | None = None
    schedule: Schedule | None = None
    daily: Daily | None = None
    patterns: tuple[Pattern, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _number(cls, data: Any) -> Any:
        if isinstance(data, int | float) and not isinstance(data, bool):
            return {"value": data}
        return data

    @model_validator(mode="after")
    def _one(self) -> Self:
        if sum(part is not None for part in (self.value, self.schedule, self.daily)) != 1:
            raise ValueError("give exactly one of value, schedule, daily")
        return self

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        described = handler.resolve_ref_schema(handler(core_schema))
        return {"anyOf": [{"type": "number"}, described], "title": "Quantity"}

    def at_time(self, time: float) -> float:
        """The value without patterns at `time` [s]."""
        if self.value is not None:
            return self.value
        course = self.schedule or self.daily
        assert course is not None  # the validator holds it
        return course.at(time)

    def planes(self, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
        """Two planes over the cells of the ground, (ny, nx): value = first × `at_time` + second."""
        zero, one = np.zeros(grid.shape[1:]), np.ones(grid.shape[1:])
        if self.patterns:
            x, y = np.meshgrid(grid.x, grid.y)
            # a pattern replaces or adds: it is linear in what lies below it
            for pattern in self.patterns:
                zero, one = pattern.apply(zero, x, y), pattern.apply(one, x, y)
        return np.rint(one - zero), zero

    def at(self, grid: Grid, time: float) -> np.ndarray:
        """The values over the cells of the ground, (ny, nx) float64, at `time` [s]."""
        factor, summand = self.planes(grid)
        return np.asarray(factor * self.at_time(time) + summand)

    @property
    def is_constant(self) -> bool:
        """True when the quantity does not vary in time."""
        return self.value is not None

    def finest(self) -> float:
        """The longest time step that follows the course [s]; infinite for a constant."""
        course = self.schedule or self.daily
        return math.inf if course is None else course.finest()

    def bounds(self) -> tuple[float, float]:
        """Numbers between which the quantity stays, everywhere and always."""
        low, high = self.course_bounds()
        for pattern in self.patterns:
            low, high = pattern.bounds(low, high)
        return low, high

    def course_bounds(self) -> tuple[float, float]:
        """Lowest and highest of `at_time`."""
        if self.value is not None:
            return self.value, self.value
        course = self.schedule or self.daily
        assert course is not None  # the validator holds it
        return course.bounds()


def _widened(low: float, high: float, changes: Iterable[tuple[bool, float]]) -> tuple[float, float]:
    """Bounds of what stays between `low` and `high` or undergoes one of the changes."""
    ends = [(number, number) if replaces else (low + number, high + number) for replaces, number in changes]
    return min(low, *(end[0] for end in ends)), max(high, *(end[1] for end in ends))


def _ends(centres: np.ndarray) -> tuple[float, float]:
    # half a cell beyond the outer centres; a single cell counts as one metre wide
    half = 0.5 * (centres[1] - centres[0]) if centres.size > 1 else 0.5
    return float(centres[0] - half), float(centres[-1] + half)
