"""The cells of moving air on the processor: compiled loops over levels, parts of them side by side."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, final

import numpy as np

from nigemizu.heat.flow import kernels, momentum, softening
from nigemizu.heat.flow.cells import INSIDE, Cells, Fluxes, Frame, Velocity
from nigemizu.heat.flow.padding import PAD, padded
from nigemizu.heat.flow.pressure import Poisson
from nigemizu.heat.flow.sources import Part
from nigemizu.heat.stepping import processors

__all__ = ["Loops"]


@final
class Loops(Cells):
    """The fields in the processor's memory.

    Parameters
    ----------
    frame : Frame

    Attributes
    ----------
    u, v, w : (nz + 4, ny + 4, nx + 4) float64, m s-1
        On the left, right (low y) and lower faces.
    warmth : (nz + 4, ny + 4, nx + 4) float64, K
        At the centres.
    """

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        self.workers = processors()
        self._pool: ThreadPoolExecutor | None = None
        grid = frame.grid
        self.u, self.v, self.w, self.warmth = (padded(grid.shape) for _ in range(4))
        self._increments = [np.zeros(grid.shape) for _ in range(4)]
        self._room = np.empty(grid.shape)
        self._nu = np.full(self.u.shape, frame.flow.viscosity)
        self._poisson = Poisson(grid, frame.walls, self._share, self.workers)

    def __enter__(self) -> Loops:
        self._pool = ThreadPoolExecutor(self.workers)
        return self

    def __exit__(self, *_: object) -> None:
        assert self._pool is not None
        self._pool.shutdown()

    # ------------------------------------------------------------------ state
    @property
    def fields(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        return self.u, self.v, self.w, self.warmth

    @property
    def viscosity(self) -> np.ndarray:
        return self._nu

    def put(self, velocity: Velocity, warmth: np.ndarray) -> None:
        for field, given in zip(self.fields, (*velocity, warmth), strict=True):
            field[INSIDE] = given
        self._fill()

    def level(self, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        k = number % self.frame.grid.shape[0] + PAD
        return self.u[k], self.v[k], self.warmth[k]

    def divergence(self) -> np.ndarray:
        return self._outflow(np.empty(self.frame.grid.shape))

    def _outflow(self, result: np.ndarray) -> np.ndarray:
        metric = self.metric
        self._levels(kernels.divergence, self.u, self.v, self.w, result, metric.rdx, metric.rdy, metric.rdz)
        return result

    # ------------------------------------------------------------------ steps
    def rates(self, lift: float, largest: float, upwards: bool) -> tuple[float, float, float]:
        metric, flow = self.metric, self.frame.flow
        if flow.closure != "none":
            law = (flow.viscosity, flow.closure_constant)
            args = (self.u, self.v, self.w, self._nu)
            self._levels(kernels.eddy_viscosity, *args, *law, metric.rdx, metric.rdy, metric.dz, metric.rdz)
            self.frame.padding.fill_viscosity(self._nu)
        args = (self.u, self.v, self.w, self._nu)
        limits = (self.warmth, lift, largest, upwards)
        found = self._levels(kernels.fastest, *args, *limits, metric.rdx, metric.rdy, metric.rdz, metric.rdzf)
        crossing, spreading, lifting = np.max(np.array(found), axis=0)
        return float(crossing), float(spreading), float(lifting)

    def push(self, a: float, dt: float, low: Fluxes, high: Fluxes, lift: float, zero: float) -> None:
        u, v, w, s, nu = *self.fields, self._nu
        frame, flow, of = self.frame, self.frame.flow, self.metric
        gu, gv, gw, gs = self._increments
        metric = (of.rdx, of.rdy, of.rdz, of.rdzf)
        self._levels(momentum.push_u, u, v, w, nu, low.u, high.u, gu, a, dt, *metric)
        if frame.grid.shape[1] > 1 or frame.walls[1] or np.any(v):
            self._levels(momentum.push_v, u, v, w, nu, low.v, high.v, gv, a, dt, *metric)
        vertical = (of.rdx, of.rdy, of.rdz, of.dz, of.rdzf)
        self._levels(momentum.push_w, u, v, w, nu, s, lift, zero, gw, a, dt, *vertical)
        eddies = 1 / flow.turbulent_prandtl if flow.closure == "vreman" else 0.0
        limited = flow.advection == "limited"
        heat = (frame.diffusivity, flow.viscosity, eddies, limited)
        self._levels(kernels.push_warmth, u, v, w, s, nu, low.heat, high.heat, gs, a, dt, *heat, *metric)

    def release(self, parts: Sequence[tuple[Part, float]]) -> None:
        for part, time in parts:
            self._increments[part.field][part.place] += time * part.rate

    def add(self, b: float, time: float) -> None:
        if self.frame.flow.closure == "none":
            for field, increment in zip(self.fields, self._increments, strict=True):
                self._levels(kernels.add, field, increment, b)
        else:
            self._add_softly(b, time)
        self.frame.padding.close(self.u, self.v, self.w)

    def _add_softly(self, b: float, time: float) -> None:
        """Increments that vertical diffusion has softened."""
        gu, gv, gw, gs = self._increments
        frame, flow, nu = self.frame, self.frame.flow, self._nu
        metric = (self.metric.rdz, self.metric.rdzf)
        drag = 0.0 if flow.ground == "rough" else 2 * flow.viscosity * self.metric.rdz[PAD]
        held = 2 * frame.diffusivity * self.metric.rdz[PAD] if frame.holds else 0.0
        momentum_ = (nu, flow.viscosity, 1.0, flow.viscosity, drag)
        heat = (nu, flow.viscosity, 1 / flow.turbulent_prandtl, frame.diffusivity, held)
        self._rows(softening.add_softly, self.u, gu, b, time, *momentum_, *metric)
        self._rows(softening.add_softly, self.v, gv, b, time, *momentum_, *metric)
        self._rows(softening.add_softly_on_faces, self.w, gw, b, time, nu, *metric)
        self._rows(softening.add_softly, self.warmth, gs, b, time, *heat, *metric)

    def project(self) -> None:
        # What the sums here put on walls, the padding takes away.
        phi = self._poisson.solve(self._outflow(self._room))
        metric = (self.metric.rdx, self.metric.rdy, self.metric.rdzf)
        self._levels(kernels.correct, self.u, self.v, self.w, phi, *metric)
        self._fill()

    def keep_mean(self, axis: int, mean: float) -> None:
        field, heights = self.fields[axis], self.frame.grid.z_widths
        levels = field[INSIDE].mean(axis=(1, 2))
        field[INSIDE] += mean - float(levels @ heights / np.sum(heights))
        self._fill()

    def _fill(self) -> None:
        self.frame.padding.fill(*self.fields)

    # ------------------------------------------------------------------ sharing of the work
    def _levels(self, kernel: Callable[..., Any], *args: Any) -> list[Any]:
        """Run a compiled loop over all levels, parts of them side by side."""
        results: list[Any] = []
        self._share(lambda first, last: results.append(kernel(first, last, *args)), self.frame.grid.shape[0])
        return results

    def _rows(self, kernel: Callable[..., Any], *args: Any) -> None:
        """The same over all rows along x."""
        self._share(lambda first, last: kernel(first, last, *args), self.frame.grid.shape[1])

    def _share(self, work: Callable[[int, int], None], count: int) -> None:
        parts = min(self.workers, count)
        bounds = np.linspace(0, count, parts + 1).astype(int)
        if self._pool is None or parts == 1:
            work(0, count)
            return
        tasks = [self._pool.submit(work, int(a), int(b)) for a, b in itertools.pairwise(bounds)]
        for task in tasks:
            task.result()
