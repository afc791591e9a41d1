r"""Which matrix of vertical diffusion advances which column of the air.

Ground that is held or gives a flux has one matrix for all columns. Ground that exchanges heat has one for
every conductance `G` (`nigemizu.heat.vertical`), and `G` may differ from column to column and change from
step to step. A step takes `G` at its middle, which is of second order in the step; only cells next to the
ground that relax faster than a step lag behind a changing `G`, by half a step. Columns of equal `G` share a
matrix. Where a pattern has more than `LEVELS` values (a picture), matrices are made for that many levels of
`G`, and a column takes the mean of its two neighbours, weighted so that `G` is met. The mean of two matrices
without negative elements, whose rows sum to one and which conserve heat, has these properties too.

Notes
-----
The levels are a geometric series. For neighbours in the ratio :math:`\rho`, the temperature errs by at most
:math:`(\rho - 1)^2 / 4` of the range `D` of all temperatures in the air and at its walls, after any number of
steps in air that is not moved sideways: with :math:`\gamma = G / \Delta z_0`, the first derivative of the
temperature after a step by :math:`\gamma` is at most :math:`D R / \gamma`, the second at most
:math:`2 D R / \gamma^2`, where `R` is the response of cold air to ground that is warmer by one. The
interpolation errs by at most an eighth of the second times the square of the distance of the levels, and the
responses to all steps sum to at most one.

The series spans at most a factor of a thousand, :math:`\rho \le 1.116` and an error of 0.4 percent of `D`
(coefficients within a factor of ten: 0.04 percent). Still smaller conductances are means of its lowest level
and of insulated ground: their flux errs by less than a thousandth of the highest conductance times `D`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import lru_cache
from typing import Final, final

import numpy as np

from nigemizu.heat.boundary import ExchangeGround, GroundBoundary, HeldGround
from nigemizu.heat.grid import Grid
from nigemizu.heat.kernels import spread_columns, spread_groups
from nigemizu.heat.quantity import Quantity
from nigemizu.heat.vertical import VerticalDiffusion

__all__ = ["LEVELS", "ColumnSteps", "ExchangeCourse", "conductance_levels"]

LEVELS: Final = 64
"""Conductances that differ are told apart up to this number; beyond it they are interpolated."""

WIDEST: Final = 1000.0
"""Largest ratio between the highest and the lowest level above zero."""

PORTION: Final = 4096
"""Columns that a worker groups at a time: enough for full blocks, few enough to stay in its cache."""

MATRIX_BYTES: Final = 2**22
"""Matrices are kept for other steps up to one volume, or this where the volume is smaller."""

Work = tuple[Callable[..., None], list[tuple[object, ...]]]


def conductance_levels(lowest: float, highest: float, count: int = LEVELS) -> np.ndarray:
    """Increasing conductances for which matrices are made; `lowest` … `highest` lie between them.

    Parameters
    ----------
    lowest, highest : float, m s-1
        Not negative.
    count : int
        Levels of the geometric series.

    Returns
    -------
    (count,) or (count + 1,) float64, m s-1
        The latter, with a leading zero, when `lowest` lies below the series.
    """
    floor = max(lowest, highest / WIDEST)
    series = np.geomspace(floor, highest, count)
    return series if lowest == floor else np.concatenate([[0.0], series])


@final
class ExchangeCourse:
    """The conductance below every column in the course of time.

    Parameters
    ----------
    grid : Grid
    column : VerticalDiffusion
    coefficient : Quantity, W m-2 K-1
    count : int
        Largest number of different conductances that are told apart.
    """

    def __init__(
        self, grid: Grid, column: VerticalDiffusion, coefficient: Quantity, count: int = LEVELS
    ) -> None:
        self.column, self.quantity = column, coefficient
        planes = np.stack([plane.ravel() for plane in coefficient.planes(grid)])
        # columns of one kind have the same coefficient at every time
        (self.factor, self.summand), kind = np.unique(planes, axis=1, return_inverse=True)
        self.kind: np.ndarray = kind.ravel()
        self.levels: np.ndarray | None = None
        if self.factor.size > count:
            low, high = (self._of_course(value) for value in coefficient.course_bounds())
            self.levels = conductance_levels(float(np.min(low)), float(np.max(high)), count)

    def _of_course(self, value: float) -> np.ndarray:
        # a sum that should be zero may round to less
        return self.column.conductance(np.maximum(self.factor * value + self.summand, 0.0))

    def at(self, time: float) -> np.ndarray:
        """Conductance below every column at `time` [s], (columns,) float64, m s-1."""
        return np.asarray(self._of_course(self.quantity.at_time(time))[self.kind])

    def matrices_at(self, time: float) -> tuple[tuple[float, ...], np.ndarray, np.ndarray]:
        """Conductances of the matrices at `time` [s], and the share of every column.

        Returns
        -------
        conductances : tuple of float, m s-1
        lower : (columns,) int64
            The matrix of the column, followed by the next one.
        upper_weight : (columns,) float64
            Weight of that next one, 0 ≤ weight ≤ 1.
        """
        wanted = self._of_course(self.quantity.at_time(time))
        if self.levels is None:
            return tuple(wanted.tolist()), self.kind, np.zeros(self.kind.size)
        lower = np.clip(np.searchsorted(self.levels, wanted, side="right") - 1, 0, self.levels.size - 2)
        below, above = self.levels[lower], self.levels[lower + 1]
        # levels may coincide where the coefficient is so high that the half cell alone resists
        weight = np.divide(wanted - below, above - below, out=np.zeros(wanted.size), where=above > below)
        weight = np.clip(weight, 0.0, 1.0)
        return tuple(self.levels.tolist()), lower[self.kind], weight[self.kind]


@final
class ColumnSteps:
    """The work of one step of vertical diffusion, with the matrices of the steps that were needed lately."""

    def __init__(self, grid: Grid, column: VerticalDiffusion, ground: GroundBoundary, workers: int) -> None:
        self.column, self.columns, self.workers = column, grid.shape[1] * grid.shape[2], workers
        self.exchange = (
            ExchangeCourse(grid, column, ground.coefficient) if isinstance(ground, ExchangeGround) else None
        )
        self.fixed = 1.0 / column.to_ground if isinstance(ground, HeldGround) else 0.0
        levels = column.widths.size
        held = 1 if self.exchange is None else len(self.exchange.matrices_at(0.0)[0])
        budget = max(8 * levels * self.columns, MATRIX_BYTES)
        self.matrices = lru_cache(max(1, budget // (8 * levels * (levels + 5) * held)))(column.steps)
        self.groups: list[tuple[object, ...]] = []

    def skin(self, lowest: np.ndarray, ground: np.ndarray, time: float) -> np.ndarray:
        """Temperature of the air's skin [K] at `time` [s], (columns,)."""
        return self.column.skin(lowest, ground, 0.0 if self.exchange is None else self.exchange.at(time))

    def work(self, step: float, middle: float, air: np.ndarray, result: np.ndarray) -> Work:
        """The compiled loop that advances `air` into `result`, and its arguments for every portion.

        Parameters
        ----------
        step : float, s
        middle : float, s
            Time at the middle of the step.
        air, result : (nz + 3, columns) float64
        """
        shares = None if self.exchange is None else self.exchange.matrices_at(middle)
        conductances = (self.fixed,) if shares is None else shares[0]
        matrices, begins, ends = self.matrices(step, conductances)
        if shares is None or len(conductances) == 1:
            corners = np.linspace(0, self.columns, self.workers + 1).astype(np.int64)
            return spread_columns, [
                (matrices[0], begins[0], ends[0], air, result, first, last)
                for first, last in itertools.pairwise(corners)
            ]
        self._group(*shares)
        return spread_groups, [
            (matrices, begins, ends, *group, air, result, first, last) for *group, first, last in self.groups
        ]

    def _group(self, conductances: tuple[float, ...], lower: np.ndarray, weight: np.ndarray) -> None:
        """Sort the columns of every portion by the matrix that they need."""
        assert self.exchange is not None
        if self.groups and (self.exchange.levels is None or self.exchange.quantity.is_constant):
            return  # the same columns as ever belong together
        portions = max(self.workers, -(-self.columns // PORTION))
        corners = np.linspace(0, self.columns, portions + 1).astype(np.int64)
        self.groups = []
        for first, last in itertools.pairwise(corners):
            places, low, high = np.arange(first, last), lower[first:last], weight[first:last]
            columns, shares = np.concatenate([places, places]), np.concatenate([1.0 - high, high])
            matrix = np.concatenate([low, low + 1])
            counted = np.flatnonzero(shares)
            order = counted[np.argsort(matrix[counted], kind="stable")]
            firsts = np.searchsorted(matrix[order], np.arange(len(conductances) + 1))
            self.groups.append((firsts, columns[order], shares[order], first, last))
