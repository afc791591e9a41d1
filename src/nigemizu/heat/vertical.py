r"""Vertical diffusion between the ground and the top, exact in time.

On every column of cells the heat equation in finite volumes is a linear system with tridiagonal matrix `A`,

.. math:: \dot T_i = \frac{1}{\Delta z_i}\left(\frac{T_{i+1} - T_i}{R_{i+1/2}} -
          \frac{T_i - T_{i-1}}{R_{i-1/2}}\right), \qquad R = \int \frac{dz}{K(z)},

plus what the ground and the top add. Since `A` depends on height alone, one matrix :math:`e^{A \Delta t}`
serves all columns above the same ground, and a step is one product of matrices, stable like an implicit one.
Ground that is held or exchanges heat enters `A` by one number, the conductance `G` between the ground's
temperature and the centre of the lowest cell. No implicit
Runge–Kutta or multistep scheme of second order is free of new extrema at every step (Bolley and Crouzeix
1978); the exponential is, because `A` has no negative element off its diagonal. It is computed without
cancellation, as a sum of non-negative terms (uniformization) that is squared repeatedly.

References
----------
C. Bolley, M. Crouzeix, RAIRO Analyse numérique 12, 237-245 (1978).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from nigemizu.heat.boundary import FluxGround, GroundBoundary, HeldGround, Top
from nigemizu.heat.grid import Grid
from nigemizu.heat.kernels import spread_columns
from nigemizu.heat.transport import Diffusivity

__all__ = ["BOUNDARY_ROWS", "VerticalDiffusion"]

BOUNDARY_ROWS: Final = 3
"""Rows that follow the levels: the ground's number at the start and at the end of the step, and the top's."""

NEGLIGIBLE: Final = 1e-17
"""Weight of a distant level below which it is left out: less than the round-off of the temperature."""

LARGEST_NORM: Final = 0.5
TERMS: Final = 20
"""Terms of the series for a norm of at most one (twice `LARGEST_NORM`): the first left out is 4e-19."""


@final
@dataclass(frozen=True, eq=False)
class VerticalDiffusion:
    """The matrix of vertical diffusion for any conductance between the ground and the lowest cell.

    Attributes
    ----------
    generator : (nz, nz) float64, s-1
        `A` above insulated ground.
    top_source : float, s-1
        What the top adds to the highest cell per kelvin.
    to_ground : float, s m-1
        Resistance of the lower half of the lowest cell.
    heat_capacity : float, J m-3 K-1, optional
        Of the air, which turns fluxes of heat into fluxes of temperature; None for held ground.
    is_flux : bool
        True when the ground gives a flux, so that its number is not a temperature.
    widths : (nz,) float64, m
        Heights of the cells.
    """

    generator: np.ndarray
    top_source: float
    to_ground: float
    heat_capacity: float | None
    is_flux: bool
    widths: np.ndarray

    @classmethod
    def build(
        cls,
        grid: Grid,
        diffusivity: Diffusivity,
        ground: GroundBoundary,
        top: Top,
    ) -> VerticalDiffusion:
        """Assemble the matrix for a grid, a diffusivity and two boundaries."""
        edges, centres = grid.z_edges - grid.z_edges[0], grid.z - grid.z_edges[0]
        widths, levels = grid.z_widths, centres.size
        between = 1.0 / diffusivity.resistance(centres[:-1], centres[1:])
        to_ground = float(diffusivity.resistance(edges[:1], centres[:1])[0])
        to_top = float(diffusivity.resistance(centres[-1:], edges[-1:])[0])

        matrix = np.zeros((levels, levels))
        lower, upper = np.arange(levels - 1), np.arange(1, levels)
        matrix[lower, upper] = between / widths[:-1]
        matrix[upper, lower] = between / widths[1:]

        top_source = 1.0 / (to_top * widths[-1]) if top.kind == "held" else 0.0
        matrix[-1, -1] -= top_source
        off_diagonal = matrix.sum(axis=1) - np.diag(matrix)
        matrix[np.diag_indices(levels)] -= off_diagonal
        heat_capacity = None if isinstance(ground, HeldGround) else ground.heat_capacity
        return cls(matrix, top_source, to_ground, heat_capacity, isinstance(ground, FluxGround), widths)

    def conductance(self, coefficient: np.ndarray) -> np.ndarray:
        """Conductance from the ground to the lowest cell [m s-1] for coefficients of exchange [W m-2 K-1].

        The exchange and the half cell of air resist one after the other.
        """
        assert self.heat_capacity is not None
        return np.asarray(coefficient / (self.heat_capacity + coefficient * self.to_ground))

    def skin(
        self, lowest: np.ndarray, ground: np.ndarray, conductance: float | np.ndarray = 0.0
    ) -> np.ndarray:
        """Temperature of the air's skin [K] between the lowest cells and the ground's numbers."""
        if self.is_flux:
            assert self.heat_capacity is not None
            return np.asarray(lowest + self.to_ground / self.heat_capacity * ground)
        if self.heat_capacity is None:
            return ground.copy()
        share = conductance * self.to_ground
        return np.asarray((1.0 - share) * lowest + share * ground)

    def steps(
        self, time_step: float, conductances: Sequence[float]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`step` and `reach` for several conductances, stacked along a first axis."""
        matrices = [self.step(time_step, conductance) for conductance in conductances]
        begins, ends = zip(*map(self.reach, matrices), strict=True)
        return np.stack(matrices), np.stack(begins), np.stack(ends)

    def step(self, time_step: float, conductance: float) -> np.ndarray:
        """The matrix that advances all columns by `time_step` [s].

        Parameters
        ----------
        time_step : float, s
        conductance : float, m s-1
            Between the ground and the lowest cell; zero for insulated ground and for a flux.

        Returns
        -------
        (nz, nz + 3) float64
            Applied to the levels followed by the ground's number at the start and at the end of the step
            (linear between) and the top's temperature. No element is negative; for a ground with a
            temperature every row sums to one, so that each new value lies between the old ones and the
            walls'. With insulated walls and with a flux, heat is conserved to round-off.
        """
        levels = self.widths.size
        ground_source = conductance / self.widths[0]
        if self.is_flux:
            assert self.heat_capacity is not None
            ground_source = 1.0 / (self.heat_capacity * self.widths[0])
        system = np.zeros((levels + BOUNDARY_ROWS, levels + BOUNDARY_ROWS))
        system[:levels, :levels] = self.generator
        system[0, 0] -= conductance / self.widths[0]
        start, slope, top = levels, levels + 1, levels + 2
        system[0, start] = ground_source
        system[-1 - BOUNDARY_ROWS, top] = self.top_source
        system[start, slope] = 1.0 / time_step
        norm = float(np.max(np.sum(np.abs(system), axis=1))) * time_step
        squarings = max(0, math.ceil(math.log2(norm / LARGEST_NORM)))
        short = time_step / 2**squarings

        # uniformization: exp(M h) = exp(-q h) exp((M + q I) h), all terms non-negative
        rate = float(np.max(-np.diag(system)))
        positive = (system + rate * np.eye(len(system))) * short
        term = np.eye(len(system))
        result = term.copy()
        for number in range(1, TERMS + 1):
            term = _product(positive, term) / number
            result += term
        result *= math.exp(-rate * short)
        self._restore(result)
        for _ in range(squarings):
            result = _product(result, result)
            self._restore(result)

        inner = result[:levels, :levels]
        inner[np.maximum(inner, inner.T) < NEGLIGIBLE] = 0.0
        self._restore(result)
        matrix = result[:levels].copy()
        if self.is_flux:
            # all that flows in must arrive: exactly the flux times the time
            arrived = self.widths @ matrix[:, [start, slope]]
            matrix[:, [start, slope]] *= time_step * ground_source * self.widths[0] / arrived * [1, 0.5]
        # from (value at the start, change) to (value at the start, value at the end)
        matrix[:, start] = np.maximum(matrix[:, start] - matrix[:, slope], 0.0)
        return matrix

    @staticmethod
    def reach(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First level and end of the levels that count, for every row of a `step`: two (nz,) int64."""
        levels = len(matrix)
        counts = matrix[:, :levels] != 0.0
        begins = np.argmax(counts, axis=1)
        ends = np.where(counts.any(axis=1), levels - np.argmax(counts[:, ::-1], axis=1), begins)
        return begins.astype(np.int64), ends.astype(np.int64)

    def _restore(self, result: np.ndarray) -> None:
        """Take away the round-off that would grow with every squaring, in place.

        Two properties of the exact exponential are put back: the symmetry of widths × matrix, and rows that
        sum to one. Together they conserve heat.
        """
        levels = self.widths.size
        inner = result[:levels, :levels]
        weighted = self.widths[:, None] * inner
        inner[:] = 0.5 * (weighted + weighted.T) / self.widths[:, None]
        total = inner.sum(axis=1) + result[:levels, levels + 2]
        if not self.is_flux:
            total += result[:levels, levels]
        diagonal = np.diag_indices(levels)
        inner[diagonal] = np.maximum(inner[diagonal] + (1.0 - total), 0.0)


def _product(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Product of two square matrices that skips the zeros beside the band of the left one.

    Not by a linear algebra library: its threads, which wait for each other over so small a product, take a
    hundred times as long on a busy machine.
    """
    result = np.empty_like(right)
    spread_columns(left, *VerticalDiffusion.reach(left), right, result, 0, len(right))
    return result
