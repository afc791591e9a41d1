"""The fields of moving air, and what a step does to all their cells at once: what every device can do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, final

import numpy as np

from nigemizu.heat.flow.padding import PAD, Padding

if TYPE_CHECKING:
    from nigemizu.heat.flow.settings import Convection
    from nigemizu.heat.flow.sources import Part
    from nigemizu.heat.grid import Grid

__all__ = ["INSIDE", "Cells", "Fluxes", "Frame", "Metric", "Velocity"]

INSIDE = (slice(PAD, -PAD),) * 3
Velocity = tuple[np.ndarray, np.ndarray, np.ndarray]


@final
class Metric:
    """Of the padded cells: what the loops multiply differences with.

    Attributes
    ----------
    rdx, rdy : float, m-1
        1/Δx, 1/Δy.
    dz, rdz : (nz + 4,) float64, m and m-1
        Heights of the cells, and one over them.
    rdzf : (nz + 5,) float64, m-1
        1 / distance between the centres beside each lower face.
    """

    def __init__(self, grid: Grid) -> None:
        self.rdx, self.rdy = (1 / grid.horizontal_step(axis) for axis in "xy")
        self.dz = np.pad(grid.z_widths, PAD, mode="symmetric" if len(grid.z) > 1 else "edge")
        self.rdz = 1 / self.dz
        between = np.empty_like(self.dz)
        between[1:] = 0.5 * (self.dz[1:] + self.dz[:-1])
        between[0] = between[1]
        self.rdzf = np.append(1 / between, 1 / between[-1])


@final
@dataclass(frozen=True, eq=False)
class Frame:
    """What stays the same throughout a flow.

    Attributes
    ----------
    grid : Grid
    flow : Convection
    padding : Padding
    walls : (bool, bool)
        Whether the sides along x and y are walls; else periodic.
    diffusivity : float, m2 s-1
        Molecular, of heat.
    holds : bool
        Whether the ground holds the temperature of the air on it, through molecules.
    """

    grid: Grid
    flow: Convection
    padding: Padding
    walls: tuple[bool, bool]
    diffusivity: float
    holds: bool


class Fluxes(NamedTuple):
    """Through a level face, upwards, (ny, nx) each: of u and v [m2 s-2] on their faces, of heat [K m s-1]."""

    u: np.ndarray
    v: np.ndarray
    heat: np.ndarray


class Cells(ABC):
    """Velocity and temperature on the staggered mesh, padded by two cells on every side.

    Parameters
    ----------
    frame : Frame

    Notes
    -----
    A step calls `push`, `release`, `add` and `project` for each of its stages; `nigemizu.heat.flow.moving`
    decides with what. Between steps the padding is filled.
    """

    def __init__(self, frame: Frame) -> None:
        self.frame, self.metric = frame, Metric(frame.grid)

    def __enter__(self) -> Cells:
        return self

    def __exit__(self, *_: object) -> None:
        """Give back what the work took beside memory."""
        return

    # ------------------------------------------------------------------ state
    @property
    @abstractmethod
    def fields(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """u, v, w [m s-1] and the warmth [K], (nz + 4, ny + 4, nx + 4) each."""

    @property
    @abstractmethod
    def viscosity(self) -> np.ndarray:
        """At the centres [m2 s-1], padded, as of the last `rates`."""

    @abstractmethod
    def put(self, velocity: Velocity, warmth: np.ndarray) -> None:
        """Take fields (nz, ny, nx), and fill their padding."""

    @abstractmethod
    def level(self, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """u, v [m s-1] and the warmth [K] of a level, (ny + 4, nx + 4) each."""

    @abstractmethod
    def divergence(self) -> np.ndarray:
        """Of the velocity [s-1] at the centres, (nz, ny, nx)."""

    # ------------------------------------------------------------------ steps
    @abstractmethod
    def rates(self, lift: float, largest: float, upwards: bool) -> tuple[float, float, float]:
        """Update the viscosity; greatest rates [s-1] of crossing cells, of diffusion across them, and of
        buoyancy, as `nigemizu.heat.flow.kernels.fastest` tells them."""

    @abstractmethod
    def push(self, a: float, dt: float, low: Fluxes, high: Fluxes, lift: float, zero: float) -> None:
        """Increments of one stage: G ← a G + dt N, with the fluxes through ground and top."""

    @abstractmethod
    def release(self, parts: Sequence[tuple[Part, float]]) -> None:
        """Add what sources release, each for a time [s], to the increments."""

    @abstractmethod
    def add(self, b: float, time: float) -> None:
        """q ← q + b G; with eddies, softened by vertical diffusion over a time [s]; `project` comes next."""

    @abstractmethod
    def project(self) -> None:
        """Take the divergence out of the velocity."""

    @abstractmethod
    def keep_mean(self, axis: int, mean: float) -> None:
        """Shift the velocity along x (0) or y (1) as a whole, so that its mean over the volume is this."""
