r"""Vertical diffusion between the ground and the top, exact in time.

On every column of cells the heat equation in finite volumes is a linear system with tridiagonal matrix `A`,

.. math:: \dot T_i = \frac{1}{\Delta z_i}\left(\frac{T_{i+1} - T_i}{R_{i+1/2}} -
          \frac{T_i - T_{i-1}}{R_{i-1/2}}\right), \qquad R = \int \frac{dz}{K(z)},

plus what the ground and the top add. Since `A` depends on height alone, one matrix :math:`e^{A \Delta t}`
serves all columns, and a step is one product of matrices, stable like an implicit one. No implicit
Runge–Kutta or multistep scheme of second order is free of new extrema at every step (Bolley and Crouzeix
1978); the exponential is, because `A` has no negative element off its diagonal. It is computed without
cancellation, as a sum of non-negative terms (uniformization) that is squared repeatedly.

References
----------
C. Bolley, M. Crouzeix, RAIRO Analyse numérique 12, 237-245 (1978).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from nigemizu.heat.boundary import ExchangeGround, FluxGround, HeldGround, Top
from nigemizu.heat.grid import Grid
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
    """The matrix of vertical diffusion and what the ground means for it.

    Attributes
    ----------
    generator : (nz, nz) float64, s-1
        `A`.
    ground_source : float, per s and unit of the ground's number
        What the ground adds to the lowest cell: per kelvin (held, exchange) or per W m-2 (flux).
    top_source : float, s-1
        What the top adds to the highest cell per kelvin.
    skin_air, skin_ground : float
        The skin's temperature is ``skin_air × lowest cell + skin_ground × the ground's number``.
    widths : (nz,) float64, m
        Heights of the cells.
    """

    generator: np.ndarray
    ground_source: float
    top_source: float
    skin_air: float
    skin_ground: float
    widths: np.ndarray

    @classmethod
    def build(
        cls,
        grid: Grid,
        diffusivity: Diffusivity,
        ground: HeldGround | FluxGround | ExchangeGround,
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

        match ground:
            case HeldGround():
                conductance, source = 1.0 / to_ground, 1.0 / (to_ground * widths[0])
                skin_air, skin_ground = 0.0, 1.0
            case FluxGround():
                conductance, source = 0.0, 1.0 / (ground.heat_capacity * widths[0])
                skin_air, skin_ground = 1.0, to_ground / ground.heat_capacity
            case ExchangeGround():
                # the exchange and the half cell of air resist one after the other
                exchange = ground.heat_capacity / ground.coefficient
                conductance = 1.0 / (exchange + to_ground)
                source = conductance / widths[0]
                skin_air = exchange * conductance
                skin_ground = to_ground * conductance
        matrix[0, 0] -= conductance / widths[0]
        top_source = 1.0 / (to_top * widths[-1]) if top.kind == "held" else 0.0
        matrix[-1, -1] -= top_source
        off_diagonal = matrix.sum(axis=1) - np.diag(matrix)
        matrix[np.diag_indices(levels)] -= off_diagonal
        return cls(matrix, float(source), top_source, skin_air, skin_ground, widths)

    @property
    def is_flux(self) -> bool:
        """True when the ground gives a flux, so that its number is not a temperature."""
        return self.skin_air == 1.0

    def step(self, time_step: float) -> np.ndarray:
        """The matrix that advances all columns by `time_step` [s].

        Parameters
        ----------
        time_step : float, s

        Returns
        -------
        (nz, nz + 3) float64
            Applied to the levels followed by the ground's number at the start and at the end of the step
            (linear between) and the top's temperature. No element is negative; for a ground with a
            temperature every row sums to one, so that each new value lies between the old ones and the
            walls'. With insulated walls and with a flux, heat is conserved to round-off.
        """
        levels = self.widths.size
        system = np.zeros((levels + BOUNDARY_ROWS, levels + BOUNDARY_ROWS))
        system[:levels, :levels] = self.generator
        start, slope, top = levels, levels + 1, levels + 2
        system[0, start] = self.ground_source
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
            term = term @ positive / number
            result += term
        result *= math.exp(-rate * short)
        self._restore(result)
        for _ in range(squarings):
            result = result @ result
            self._restore(result)

        inner = result[:levels, :levels]
        inner[np.maximum(inner, inner.T) < NEGLIGIBLE] = 0.0
        self._restore(result)
        matrix = result[:levels].copy()
        if self.is_flux:
            # all that flows in must arrive: exactly the flux times the time
            arrived = self.widths @ matrix[:, [start, slope]]
            matrix[:, [start, slope]] *= time_step * self.ground_source * self.widths[0] / arrived * [1, 0.5]
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
