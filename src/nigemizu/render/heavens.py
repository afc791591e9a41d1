"""What one wavelength shows beyond the air: Sun, Moon and sky, on the compute device."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

__all__ = ["COLUMNS", "Disc", "Heavens", "elevation_nodes"]

FloatArray = NDArray[np.float64]

FINEST: Final = math.radians(0.05)  # over which the nodes of elevation are evenly spaced, about the horizon
ROWS: Final = 384
COLUMNS: Final = 96


@final
@dataclass(frozen=True)
class Disc:
    """A body of the sky for one wavelength.

    Parameters
    ----------
    direction : (3,) float64
        Unit vector to its middle, without air.
    radius : float, rad
    radiance : (N,) float64
        At equal steps of the distance from the middle, from 0 to the limb; without air.
    lit : (3,) float64, optional
        Unit vector from its middle to where it is lit from, for a ball; None shines by itself.
    """

    direction: FloatArray
    radius: float
    radiance: FloatArray
    lit: FloatArray | None = None


def elevation_nodes(low: float, count: int = ROWS) -> FloatArray:
    """Apparent elevations [rad] of the tables, from `low` to the zenith: dense about the horizon."""
    first, last = np.arcsinh(low / FINEST), np.arcsinh(math.pi / 2 / FINEST)
    return np.asarray(np.sinh(np.linspace(first, last, count)) * FINEST)


@final
class Heavens:
    """Sun, Moon and sky as one wavelength shows them.

    Parameters
    ----------
    low : float, rad
        Lowest apparent elevation of the tables.
    sky : (ROWS, COLUMNS) float64
        Radiance at `elevation_nodes` and `nigemizu.render.firmament.azimuth_nodes`.
    transmission : (ROWS,) float64, 1
        Of the air, to space.
    bodies : sequence of Disc
    sun_azimuth : float, rad
    colour : (3,) float64
        Red, green, blue of a unit of radiance.
    mixing : (3, 3) float64
        What this wavelength takes of an object's red, green and blue.
    extinction : sequence of (float, float), 1/m and m
        Coefficient at height 0 and scale height of what dims objects.
    index : (eye, top) float or None
        n′ at the eye and at the top of the air, where the air is not all in layers: the elevation at the eye
        is then told from the direction above the air. None: it is that of the ray itself.

    Notes
    -----
    Objects are dimmed along the straight line to them; the light that the air adds is that of the sky just
    over the horizon, as much as the object's is dimmed.
    """

    def __init__(
        self,
        *,
        low: float,
        sky: FloatArray,
        transmission: FloatArray,
        bodies: tuple[Disc, ...],
        sun_azimuth: float,
        colour: FloatArray,
        mixing: FloatArray,
        extinction: tuple[tuple[float, float], ...],
        index: tuple[float, float] | None = None,
    ) -> None:
        # Opaque: the kernel of one wavelength serves them all.
        ends = np.arcsinh(np.array([low, math.pi / 2]) / FINEST)
        self._first = _opaque(ends[0])
        self._per_row = _opaque((ROWS - 1) / (ends[1] - ends[0]))
        self._sky = mi.Float(np.ascontiguousarray(sky.ravel(), dtype=np.float32))
        self._transmission = mi.Float(np.asarray(transmission, dtype=np.float32))
        self._bodies = [_Body(disc) for disc in bodies]
        self._sun_azimuth = _opaque(sun_azimuth)
        self._colour = mi.Color3f(*(_opaque(part) for part in colour))
        self._mixing = [[_opaque(part) for part in row] for row in mixing]
        self._extinction = [(_opaque(beta), scale) for beta, scale in extinction]
        self._cosines = None if index is None else _opaque(index[1] / index[0])
        self._horizon = _opaque(max(low, 0.0) + 1e-4)

    def elevation(self, apparent: Any, local: Any) -> Any:
        """Apparent elevation [rad] that the tables go by, of a ray from the eye and its end above the air."""
        if self._cosines is None:
            return dr.asin(dr.clip(apparent.z, -1, 1))
        cosine = self._cosines * dr.sqrt(dr.maximum(1 - local.z * local.z, 0))
        return dr.acos(dr.clip(cosine, 0, 1))

    def radiance(self, direction: Any, elevation: Any, active: Any) -> Any:
        """Colour of what lies beyond the air, and of the air before it.

        Parameters
        ----------
        direction : Vector3f
            Of the light above the air, in the eye's axes.
        elevation : Float, rad
            Apparent elevation at the eye.
        """
        row, fraction = self._row(elevation)
        clear = _between(self._transmission, row, fraction, active)
        light = self._glow(row, fraction, direction, active)
        for body in self._bodies:
            light += clear * body.radiance(direction, active)
        return self._colour * light

    def airlight(self, direction: Any, active: Any) -> Any:
        """Colour of endless air, in the azimuth of a direction."""
        row, fraction = self._row(self._horizon)
        return self._colour * self._glow(row, fraction, direction, active)

    def clear(self, length: Any, height: Any, other: Any) -> Any:
        """Part of an object's light that is left after a way [m] between two heights [m]."""
        depth = mi.Float(0)
        for beta, scale in self._extinction:
            low, climb = dr.minimum(height, other), abs(height - other) * (1 / scale)
            mean = dr.select(climb > 1e-3, (1 - dr.exp(-climb)) / dr.maximum(climb, 1e-3), 1 - climb / 2)
            depth += beta * dr.exp(-low * (1 / scale)) * mean
        return dr.exp(-depth * length)

    def mixed(self, colour: Any) -> Any:
        """What this wavelength takes of an object's colour."""
        return mi.Color3f(
            *(row[0] * colour[0] + row[1] * colour[1] + row[2] * colour[2] for row in self._mixing)
        )

    def _row(self, elevation: Any) -> tuple[Any, Any]:
        place = (_asinh(elevation * (1 / FINEST)) - self._first) * self._per_row
        place = dr.clip(place, 0, ROWS - 1)
        row = dr.minimum(mi.UInt32(place), ROWS - 2)
        return row, place - mi.Float(row)

    def _glow(self, row: Any, fraction: Any, direction: Any, active: Any) -> Any:
        turn = dr.atan2(direction.y, direction.x) - self._sun_azimuth
        turn = abs(turn - 2 * math.pi * dr.round(turn * (0.5 / math.pi)))
        place = dr.sqrt(turn * (1 / math.pi)) * (COLUMNS - 1)
        column = dr.minimum(mi.UInt32(place), COLUMNS - 2)
        across = place - mi.Float(column)
        first = row * COLUMNS + column
        below = _between(self._sky, first, across, active)
        above = _between(self._sky, first + COLUMNS, across, active)
        return dr.lerp(below, above, fraction)


@final
class _Body:
    def __init__(self, disc: Disc) -> None:
        self._direction = mi.Vector3f(*(_opaque(part) for part in disc.direction))
        self._inverse = _opaque(1 / math.sin(disc.radius))
        self._last = len(disc.radiance) - 1
        self._radiance = mi.Float(np.asarray(disc.radiance, dtype=np.float32))
        self._lit = None if disc.lit is None else mi.Vector3f(*(_opaque(part) for part in disc.lit))

    def radiance(self, direction: Any, active: Any) -> Any:
        towards = dr.dot(direction, self._direction)
        # Both are unit vectors: their difference has no loss of digits near the middle.
        away = dr.fma(-towards, self._direction, direction)
        distance = dr.norm(away) * self._inverse
        on_disc = active & (towards > 0) & (distance < 1)
        place = dr.minimum(distance, 1) * self._last
        step = dr.minimum(mi.UInt32(place), self._last - 1)
        light = _between(self._radiance, step, place - mi.Float(step), on_disc)
        if self._lit is not None:
            rise = dr.sqrt(dr.maximum(1 - distance * distance, 0))
            normal = away * self._inverse - self._direction * rise
            # Lommel and Seeliger: a rough ball is as bright at its limb as in its middle.
            incident = dr.maximum(dr.dot(normal, self._lit), 0)
            light *= 2 * incident / dr.maximum(incident + rise, 1e-6)
        return dr.select(on_disc, light, 0)


def _between(table: Any, first: Any, fraction: Any, active: Any) -> Any:
    one, other = (dr.gather(mi.Float, table, index, active) for index in (first, first + 1))
    return dr.lerp(one, other, fraction)


def _asinh(x: Any) -> Any:
    return dr.copysign(dr.log(abs(x) + dr.sqrt(dr.fma(x, x, 1))), x)


def _opaque(value: float) -> Any:
    return dr.opaque(mi.Float, float(value))
