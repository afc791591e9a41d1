"""Coefficients of the horizontal motion for one time step, level by level."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from nigemizu.heat.boundary import Sides
from nigemizu.heat.grid import Grid
from nigemizu.heat.transport import Diffusivity, Wind

__all__ = ["HorizontalMotion", "carry_weights", "spreading_kernel"]

NEGLIGIBLE: Final = 1e-16
"""Weight below which a kernel of diffusion is cut off: the round-off of the temperature itself."""


@final
@dataclass(frozen=True, eq=False)
class HorizontalMotion:
    """Arguments of `nigemizu.heat.kernels.move_levels` for one time step; None in `moves` if at rest."""

    shifts: np.ndarray
    parts: np.ndarray
    carry: np.ndarray
    halves: np.ndarray
    kernels: np.ndarray
    periodic: np.ndarray

    @property
    def is_still(self) -> bool:
        """True when nothing moves along x and y."""
        return not (self.shifts.any() or self.parts.any() or self.halves.any())

    @classmethod
    def build(
        cls, grid: Grid, diffusivity: Diffusivity, wind: Wind, sides: Sides, time_step: float
    ) -> HorizontalMotion:
        """Whole cells, Courant numbers, and kernels of every level for a time step [s]."""
        heights = grid.z - grid.z_edges[0]
        levels, ny, nx = grid.shape
        shifts, parts = np.zeros((2, levels), dtype=np.int64), np.zeros((2, levels))
        carry = np.zeros((2, levels, 5))
        kernels: list[list[np.ndarray]] = []
        periodic = np.array([sides.x == "periodic", sides.y == "periodic"])
        axes = zip(("x", "y"), (nx, ny), wind.velocity(heights), diffusivity.sideways(heights), strict=True)
        for number, (axis, count, speed, spread) in enumerate(axes):
            step = grid.horizontal_step(axis)
            if count > 1:
                shifts[number], parts[number] = _whole_and_part(speed * time_step / step)
            carry[number] = carry_weights(parts[number])
            numbers = spread * time_step / step**2
            known = {r: spreading_kernel(r, count, bool(periodic[number])) for r in np.unique(numbers)}
            kernels.append([known[r] for r in numbers])
        halves = np.array([[kernel.size - 1 for kernel in along] for along in kernels], dtype=np.int64)
        table = np.zeros((2, levels, int(halves.max()) + 1))
        for number, along in enumerate(kernels):
            for level, kernel in enumerate(along):
                table[number, level, : kernel.size] = kernel
        return cls(shifts, parts, carry, halves, table, periodic)


def _whole_and_part(courant: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    whole = np.floor(courant)
    part = courant - whole
    # within round-off of a whole number of cells the motion is a plain copy
    whole, part = np.where(part > 1 - 1e-13, whole + 1, whole), np.where(part > 1 - 1e-13, 0.0, part)
    return whole.astype(np.int64), np.where(part < 1e-13, 0.0, part)


def carry_weights(courant: np.ndarray) -> np.ndarray:
    """Weights of the five cells about the donor for the value carried through its downwind face.

    The running sum of the cells is known at the six faces around the donor; the quintic through them gives
    the content of the piece of length `c` upwind of the face, whose mean is the value carried.

    Parameters
    ----------
    courant : (n,) float64
        0 ≤ c < 1, in cells.

    Returns
    -------
    (n, 5) float64
        From two cells upwind to two cells downwind; rows sum to one. For c = 0 all zero.
    """
    faces = np.arange(-3.0, 3.0)  # the donor lies between -1 and 0
    weights = np.zeros((courant.size, 5))
    for row, c in zip(weights, courant, strict=True):
        if c == 0:
            continue
        lagrange = np.array(
            [math.prod((-c - other) / (face - other) for other in faces if other != face) for face in faces]
        )
        at_face = (faces == 0.0).astype(np.float64)
        # the running sum at a face holds all cells before it
        differences = at_face - lagrange
        row[:] = np.cumsum(differences[::-1])[::-1][1:] / c
    return weights


def spreading_kernel(number: float, count: int, periodic: bool) -> np.ndarray:
    r"""Weights by which diffusion spreads one cell over its neighbours, exact in time.

    Parameters
    ----------
    number : float
        Diffusivity times time step over the square of the cell.
    count : int
        Number of cells along the axis.
    periodic : bool
        Periodic, or insulated (then the line is continued by its mirror image).

    Returns
    -------
    (half + 1,) float64
        From the centre outwards, none negative, ``w[0] + 2 sum(w[1:]) == 1``.

    Notes
    -----
    The semi-discrete equation :math:`\dot T_i = r (T_{i-1} - 2 T_i + T_{i+1})` has the Green's function
    :math:`e^{-2 r t} I_n(2 r t)`, positive for every step, so that nothing ever overshoots. It is summed over
    the period here by the inverse Fourier transform of :math:`\exp(-4 r \sin^2(\pi m / N))`.
    """
    if count == 1 or number == 0.0:
        return np.ones(1)
    period = count if periodic else 2 * count
    decay = np.exp(-4.0 * number * np.sin(np.pi * np.arange(period) / period) ** 2)
    line = np.maximum(np.fft.ifft(decay).real[: period // 2 + 1], 0.0)
    if period % 2 == 0:
        line[-1] *= 0.5  # the farthest cell is reached from both sides
    half = int(np.max(np.flatnonzero(line > NEGLIGIBLE)))
    line = line[: half + 1]
    line[0] = 1.0 - 2.0 * math.fsum(line[1:]) if line[0] > 0.1 else line[0]
    return np.asarray(line / (line[0] + 2.0 * math.fsum(line[1:])))
