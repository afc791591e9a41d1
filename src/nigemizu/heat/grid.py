"""The orthogonal mesh of the air, stretched in height so that the hot first centimetre is resolved."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Final, Self, final

import numpy as np
from pydantic import Field, model_validator

from nigemizu.errors import InputError
from nigemizu.heat.measures import Metres
from nigemizu.memory import available_memory
from nigemizu.values import Value

__all__ = ["Grid", "GridSpec", "require_memory"]

LARGEST_STRETCH: Final = 1.5
"""Neighbouring cells differ in height by at most this ratio; beyond it the second order is lost."""

VOLUMES_IN_MEMORY: Final = 6
"""Copies of the temperature volume held at most while it evolves and one state is with the caller."""


@final
@dataclass(frozen=True, eq=False)
class Grid:
    """Cells of an orthogonal mesh, given by the positions of their faces.

    Parameters
    ----------
    x_edges, y_edges, z_edges : (n + 1,) float64, m
        Increasing positions of the faces; x forward, y left, z up; ``z_edges[0]`` is the ground.

    Raises
    ------
    InputError
        For edges that are not finite and increasing.
    """

    x_edges: np.ndarray
    y_edges: np.ndarray
    z_edges: np.ndarray

    def __post_init__(self) -> None:
        for name in ("x_edges", "y_edges", "z_edges"):
            edges = np.array(getattr(self, name), dtype=np.float64)
            if edges.ndim != 1 or edges.size < 2:
                raise InputError("a grid needs at least one cell along each axis", key=f"grid.{name}")
            if not np.all(np.isfinite(edges)) or not np.all(np.diff(edges) > 0):
                raise InputError("the edges of the cells must be finite and increase", key=f"grid.{name}")
            edges.setflags(write=False)
            object.__setattr__(self, name, edges)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of cells ``(nz, ny, nx)``: the shape of every volume of the heat stage."""
        return self.z_edges.size - 1, self.y_edges.size - 1, self.x_edges.size - 1

    @cached_property
    def x(self) -> np.ndarray:
        """Cell centres along x, (nx,) float64, m."""
        return _centres(self.x_edges)

    @cached_property
    def y(self) -> np.ndarray:
        """Cell centres along y, (ny,) float64, m."""
        return _centres(self.y_edges)

    @cached_property
    def z(self) -> np.ndarray:
        """Cell centres in height, (nz,) float64, m."""
        return _centres(self.z_edges)

    @cached_property
    def x_widths(self) -> np.ndarray:
        """Cell widths along x, (nx,) float64, m."""
        return np.diff(self.x_edges)

    @cached_property
    def y_widths(self) -> np.ndarray:
        """Cell widths along y, (ny,) float64, m."""
        return np.diff(self.y_edges)

    @cached_property
    def z_widths(self) -> np.ndarray:
        """Cell heights, (nz,) float64, m."""
        return np.diff(self.z_edges)

    @property
    def volumes(self) -> np.ndarray:
        """Volume of every cell, (nz, ny, nx) float64, m3."""
        return np.asarray(self.z_widths[:, None, None] * self.y_widths[:, None] * self.x_widths)

    def horizontal_step(self, axis: str) -> float:
        """The common width of the cells along ``"x"`` or ``"y"`` [m].

        Raises
        ------
        InputError
            When the cells are not uniform along that axis.
        """
        widths = self.x_widths if axis == "x" else self.y_widths
        step = float(np.mean(widths))
        if np.max(np.abs(widths - step)) > 1e-6 * step:
            raise InputError(
                "the heat stage needs cells of equal width along the horizontal axes",
                key=f"grid.{axis}_edges",
                remedy="only the heights of the cells may be stretched",
            )
        return step


Interval = tuple[Metres, Metres]
Count = Annotated[int, Field(ge=1)]


@final
class GridSpec(Value):
    """The mesh as a person describes it: a box, the number of cells, and how thin the first cell is.

    Parameters
    ----------
    x, y : (float, float), m
        Ends of the box forward and to the left.
    height : float, m
        Height of the box above the ground.
    cells : (int, int, int)
        Number of cells along x, y and z.
    first_cell : float, optional, m
        Height of the lowest cell. The cells above it grow by a constant ratio, found so that the top is
        at `height`. Left out, all cells have the same height.

    Examples
    --------
    >>> grid = GridSpec(x=(0, 8), y=(-2, 2), height=2.0, cells=(16, 8, 24), first_cell=0.005).build()
    >>> grid.shape
    (24, 8, 16)
    >>> round(float(grid.z_widths[0]), 6), round(float(grid.z_edges[-1]), 6)
    (0.005, 2.0)
    """

    x: Interval
    y: Interval
    height: Metres = Field(gt=0)
    cells: tuple[Count, Count, Count]
    first_cell: Metres | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _box_is_not_empty(self) -> Self:
        for name in ("x", "y"):
            low, high = getattr(self, name)
            if not high > low:
                raise ValueError(f"{name}: the second end must lie above the first, got ({low}, {high})")
        self._stretch()
        return self

    def _stretch(self) -> float:
        """The ratio between the heights of neighbouring cells."""
        levels = self.cells[2]
        if self.first_cell is None or levels == 1:
            return 1.0
        total = self.height / self.first_cell
        if total < levels * (1 - 1e-12):
            raise ValueError(
                f"first_cell: {self.first_cell} m is thicker than the mean cell of "
                f"{self.height / levels:.4g} m; choose a thinner first cell or fewer cells"
            )
        # the sum of the geometric series grows with the ratio: bisect
        if _geometric_sum(LARGEST_STRETCH, levels) < total:
            needed = math.ceil(math.log1p(total * (LARGEST_STRETCH - 1)) / math.log(LARGEST_STRETCH))
            raise ValueError(
                f"first_cell: {levels} cells cannot reach {self.height} m from a first cell of "
                f"{self.first_cell} m without growing by more than {LARGEST_STRETCH} from one to the next; "
                f"use a thicker first cell or at least {needed} cells in height"
            )
        low, high = 1.0, LARGEST_STRETCH
        while (middle := 0.5 * (low + high)) not in (low, high):
            if _geometric_sum(middle, levels) < total:
                low = middle
            else:
                high = middle
        return low

    def build(self) -> Grid:
        """The mesh with its faces in place."""
        nx, ny, nz = self.cells
        widths = self._stretch() ** np.arange(nz)
        z_edges = np.concatenate([[0.0], np.cumsum(widths)]) * (self.height / np.sum(widths))
        z_edges[-1] = self.height
        return Grid(np.linspace(*self.x, nx + 1), np.linspace(*self.y, ny + 1), z_edges)

    def memory(self) -> int:
        """Bytes that the heat stage needs for this mesh, at most."""
        return math.prod(self.cells) * 8 * VOLUMES_IN_MEMORY


def _centres(edges: np.ndarray) -> np.ndarray:
    return np.asarray(0.5 * (edges[1:] + edges[:-1]))


def _geometric_sum(ratio: float, terms: int) -> float:
    # expm1 keeps the digits for ratios next to 1
    if ratio == 1.0:
        return float(terms)
    return math.expm1(terms * math.log(ratio)) / (ratio - 1.0)


def require_memory(
    cells: int, *, available: Callable[[], int | None] = available_memory, volumes: int = VOLUMES_IN_MEMORY
) -> None:
    """Refuse a volume that cannot be held, before it is allocated.

    Parameters
    ----------
    cells : int
        Number of cells of the mesh.
    available : callable
        Tells the bytes at hand, or None if unknown (then nothing is refused).
    volumes : int
        Number of float64 volumes that will be needed.

    Raises
    ------
    InputError
        With both sizes, when the volume does not fit.
    """
    need, have = cells * 8 * volumes, available()
    if have is not None and need > have:
        raise InputError(
            f"this grid of {cells:,} cells needs {need / 2**30:.2f} GiB of memory, "
            f"and {have / 2**30:.2f} GiB are available",
            key="grid.cells",
            remedy="use fewer cells",
        )
