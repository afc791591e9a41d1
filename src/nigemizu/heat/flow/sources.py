"""Sources in moving air: small regions that are heated or pushed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple, final

import numpy as np
from pydantic import Field

from nigemizu.air import density
from nigemizu.errors import InputError
from nigemizu.heat.grid import Grid
from nigemizu.heat.measures import Degrees, Metres, Newtons, Seconds, Watts
from nigemizu.values import Value

__all__ = ["SPECIFIC_HEAT", "Part", "Release", "Source", "air_density", "require_inside"]

SPECIFIC_HEAT: Final = 1006.0
"""Of dry air at constant pressure [J kg-1 K-1], as for the ground's heat flux."""
_PRESSURE: Final = 101325.0  # Pa
_ACROSS: Final = 0.999  # of a cell: what a source is wide at least, but for round-off


@final
class Source(Value):
    r"""A small region of air that is heated, or pushed: a burner, a fan, an engine.

    Parameters
    ----------
    position : (x, y, z), m
        Its middle.
    size : (x, y, z), m
        Whole widths; those of a ball are its diameters, and a cylinder stands upright. Of a cell at least.
    shape : {"ball", "box", "cylinder"}
        Of the region.
    power : float, W
        Heat that the air receives; below zero it is cooled.
    thrust : float, N
        Force on the air.
    heading : float, degrees
        Where the force points, 0 = along +x, positive to the left.
    elevation : float, degrees
        Of the force above the horizontal.
    start : float, s
        When it is switched on.

    Notes
    -----
    .. math:: \partial_t \theta = \dots + \frac{P\,s}{\rho c_p}, \qquad \partial_t \mathbf{u} = \dots +
              \frac{F\,s}{\rho}, \qquad \int s\,dV = 1

    with ρ the density of dry air at the mean temperature of the beginning and at 101325 Pa. The weight s is
    even inside, and falls linearly over the width of a cell at the edge; its sum over the cells (for the
    force: over the faces that carry the velocity) is one to round-off, whatever the cells.

    Limits: the density is the same everywhere but for the weight of the air (Boussinesq). Air that is hotter
    by ΔT is in truth lighter by about ΔT/T: at 30 K by a tenth, at 300 K by half. What comes out of a flame
    or a jet pipe is right only from where it has mixed down to some ten kelvin; power and thrust, on which a
    plume or a jet depends from there on, are exact. The region stands in nobody's way and adds no mass. A
    jet of thrust F from an area A reaches :math:`\sqrt{2F/(\rho A)}` in still air: its size sets its speed at
    the start. In a box whose sides are periodic, what leaves comes in again on the other side.

    Examples
    --------
    >>> burner = Source.model_validate({"position": [0, 0, "5 cm"], "size": ["6 cm"] * 3, "power": "1 kW"})
    >>> burner.position, burner.power
    ((0.0, 0.0, 0.05), 1000.0)
    """

    position: tuple[Metres, Metres, Metres]
    size: tuple[Metres, Metres, Metres]
    shape: Literal["ball", "box", "cylinder"] = "ball"
    power: Watts = 0.0
    thrust: Newtons = Field(default=0.0, ge=0)
    heading: Degrees = Field(default=0.0, ge=-360, le=360)
    elevation: Degrees = Field(default=0.0, ge=-90, le=90)
    start: Seconds = Field(default=0.0, ge=0)

    @property
    def force(self) -> tuple[float, float, float]:
        """The force on the air along x, y and z [N]."""
        heading, elevation = math.radians(self.heading), math.radians(self.elevation)
        level = self.thrust * math.cos(elevation)
        return level * math.cos(heading), level * math.sin(heading), self.thrust * math.sin(elevation)


def air_density(temperature: float) -> float:
    """Of the dry air that sources act on [kg m-3], at a temperature [K]."""
    return float(density(temperature, _PRESSURE))


def require_inside(grid: Grid, sources: Sequence[Source]) -> None:
    """Refuse sources that reach beyond the grid, or are smaller than its cells, or do nothing.

    An axis along which the grid has one cell is not looked at: there a source is as wide as the grid.
    """
    for number, source in enumerate(sources):
        key = f"sources.{number}"
        if min(source.size) <= 0:
            raise InputError(
                "has no extent", key=f"{key}.size", value=list(source.size), expected="metres above zero"
            )
        if source.power == 0 and source.thrust == 0:
            raise InputError("releases nothing", key=key, remedy="give it a power or a thrust")
        edges = (grid.x_edges, grid.y_edges, grid.z_edges)
        for axis, at, width, faces in zip("xyz", source.position, source.size, edges, strict=True):
            _require_room(axis, at, width, faces, key)


def _require_room(axis: str, at: float, width: float, faces: np.ndarray, key: str) -> None:
    if len(faces) == 2:
        return
    low, high = at - 0.5 * width, at + 0.5 * width
    slack = 1e-9 * (faces[-1] - faces[0])
    if low < faces[0] - slack or high > faces[-1] + slack:
        raise InputError(
            f"reaches from {low:g} m to {high:g} m along {axis}, out of the grid",
            key=f"{key}.position",
            value=at,
            expected=f"within {faces[0]:g} m to {faces[-1]:g} m",
            remedy="move it, make it smaller, or enlarge the grid",
        )
    place = min(int(np.searchsorted(faces, at, side="right")), len(faces) - 1)
    cell = float(faces[place] - faces[place - 1])
    if width < _ACROSS * cell:
        raise InputError(
            f"is smaller than a cell along {axis}",
            key=f"{key}.size",
            value=width,
            expected=f"{cell:g} m at least",
            remedy="make it larger, or the cells smaller (grid.cells, grid.first_cell)",
        )


class Part(NamedTuple):
    """What one source does to one field (u, v, w, warmth: 0 to 3): a box of cells and the rate in each."""

    field: int
    place: tuple[slice, slice, slice]
    rate: np.ndarray


@final
class Release:
    """What sources do to the increments of velocity and temperature.

    Parameters
    ----------
    grid : Grid
    sources : sequence of Source
    walls : (bool, bool)
        Whether the sides along x and y are walls, through whose faces nothing is pushed.
    """

    def __init__(self, grid: Grid, sources: Sequence[Source], walls: tuple[bool, bool]) -> None:
        require_inside(grid, sources)
        self._grid, self._sources = grid, tuple(sources)
        self._weights = [[_weights(grid, source, field, walls) for field in range(4)] for source in sources]
        self._parts: list[list[Part]] = []
        self._rates: list[tuple[float, float]] = []

    def set_air(self, temperature: float, lift: float) -> None:
        """The mean temperature [K], and the acceleration that a kelvin more gives [m s-2 K-1]."""
        rho = air_density(temperature)
        self._parts, self._rates = [], []
        for source, weights in zip(self._sources, self._weights, strict=True):
            strengths = (*(force / rho for force in source.force), source.power / (rho * SPECIFIC_HEAT))
            parts = [
                Part(field, place, strength * rate)
                for field, (strength, (place, rate)) in enumerate(zip(strengths, weights, strict=True))
                if strength != 0
            ]
            self._parts.append(parts)
            self._rates.append(self._rates_of(parts, lift))

    def during(self, time: float, step: float) -> list[tuple[Part, float]]:
        """What is released from `time` on during a step [s], and for how long of it."""
        released = []
        for source, parts in zip(self._sources, self._parts, strict=True):
            while_on = min(step, time + step - source.start)
            if while_on > 0:
                released += [(part, while_on) for part in parts]
        return released

    def rates(self, before: float) -> tuple[float, float]:
        """What sources that start before an instant [s] do to air at rest: the greatest acceleration over the
        width of a cell [s-2], and the greatest growth of g Δθ/(θ₀ Δz) [s-3]."""
        active = [
            rates for source, rates in zip(self._sources, self._rates, strict=True) if source.start < before
        ]
        return max((pushing for pushing, _ in active), default=0.0), max(
            (heat for _, heat in active), default=0.0
        )

    def next_start(self, time: float) -> float:
        """When the next source starts after an instant [s]; infinite if none does."""
        return min((source.start for source in self._sources if source.start >= time), default=math.inf)

    def _rates_of(self, parts: list[Part], lift: float) -> tuple[float, float]:
        grid, pushing, heating = self._grid, 0.0, 0.0
        for field, place, rate in parts:
            strongest = np.max(np.abs(rate), axis=(1, 2), initial=0.0)
            heights = grid.z_widths[place[0]]
            if field == 3:
                heating = float(np.max(lift * strongest / heights))
            else:
                across = heights if field == 2 else grid.horizontal_step("xy"[field])
                pushing += float(np.max(strongest / across, initial=0.0))
        return pushing, heating


def _weights(
    grid: Grid, source: Source, field: int, walls: tuple[bool, bool]
) -> tuple[tuple[slice, slice, slice], np.ndarray]:
    """Where a source acts on u, v, w or the temperature (0 to 3), and s there [m-3]: Σ s V = 1."""
    axes = []
    for axis, name in enumerate("xyz"):
        edges = getattr(grid, f"{name}_edges")
        widths = np.diff(edges)
        middles = getattr(grid, name)
        if axis == field:
            blocked = axis == 2 or walls[axis]
            before = np.concatenate([[0.0 if blocked else widths[-1]], widths[:-1]])
            middles, widths = edges[:-1], np.where(before > 0, 0.5 * (before + widths), 0.0)
        axes.append((middles, widths, source.position[axis], 0.5 * source.size[axis], len(edges) == 2))
    dx, dy, dz = (widths for _, widths, *_ in axes)
    volumes = dz[:, None, None] * dy[:, None] * dx
    share = _share(source.shape, axes) * (volumes > 0)
    place = tuple(
        slice(int(found[0]), int(found[-1]) + 1)
        for axis in range(3)
        if len(found := np.flatnonzero(share.any(axis=tuple({0, 1, 2} - {axis}))))
    )
    if len(place) < 3:  # nothing to push: the only face lies on a wall
        nowhere = slice(0, 0)
        return (nowhere, nowhere, nowhere), np.zeros((0, 0, 0))
    cut, volumes = share[place], volumes[place]
    total = math.fsum((cut * volumes).ravel())
    return (place[0], place[1], place[2]), cut / total


def _share(shape: str, axes: list[tuple[np.ndarray, np.ndarray, float, float, bool]]) -> np.ndarray:
    """1 inside, 0 outside, and a linear fall over a cell's width at the edge: (nz, ny, nx)."""
    offsets, cells = [], []
    for middles, widths, at, half, alone in axes:
        offsets.append(np.zeros(len(middles)) if alone else (middles - at) / half)
        cells.append(np.maximum(widths, 1e-300) / half)
    straight = [
        np.clip((1 - np.abs(offset)) / cell + 0.5, 0.0, 1.0)
        for offset, cell in zip(offsets, cells, strict=True)
    ]
    if shape == "box":
        return np.asarray(straight[2][:, None, None] * straight[1][:, None] * straight[0])
    count = 3 if shape == "ball" else 2
    spread = [
        (offset.reshape(-1, *(1,) * axis), cell.reshape(-1, *(1,) * axis))
        for axis, (offset, cell) in enumerate(zip(offsets, cells, strict=True))
    ][:count]
    distance = np.sqrt(sum(offset**2 for offset, _ in spread))
    # the width of a cell along the line from the middle, in units of the radius
    cell = np.sqrt(sum((offset * width) ** 2 for offset, width in spread)) / np.maximum(distance, 1e-300)
    round_ = np.where(distance > 0, np.clip((1 - distance) / np.maximum(cell, 1e-300) + 0.5, 0.0, 1.0), 1.0)
    return np.asarray(round_ if count == 3 else straight[2][:, None, None] * round_)
