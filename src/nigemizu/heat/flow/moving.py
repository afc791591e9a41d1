"""Moving air: its state, and one step of the equations of Boussinesq."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, final

import numpy as np

from nigemizu.heat.boundary import GroundBoundary, Sides, Top
from nigemizu.heat.flow import kernels, momentum, softening
from nigemizu.heat.flow.ground import GroundLayer
from nigemizu.heat.flow.padding import PAD, pad_ends, pad_sides, padded
from nigemizu.heat.flow.pressure import Poisson
from nigemizu.heat.flow.settings import Convection
from nigemizu.heat.flow.sources import Release, Source
from nigemizu.heat.grid import Grid
from nigemizu.heat.stepping import processors, top_temperature

__all__ = ["MovingAir"]

_A: Final = (0.0, -5 / 9, -153 / 128)
_B: Final = (1 / 3, 15 / 16, 8 / 15)
_C: Final = (0.0, 1 / 3, 3 / 4)
"""Williamson's Runge–Kutta scheme of third order: G ← A G + Δt N, q ← q + B G at t + C Δt."""
_SPREADING: Final = 2.0  # of 2.51, where the scheme stops being stable on the negative real axis
_LIFTING: Final = 1.0  # radians that internal waves or growing plumes may turn or grow in a step

Velocity = tuple[np.ndarray, np.ndarray, np.ndarray]
INSIDE: Final = (slice(PAD, -PAD),) * 3


@final
class MovingAir:
    r"""Velocity and temperature on a staggered mesh.

    Parameters
    ----------
    grid : Grid
    flow : Convection
    ground, sides, top
        As for `nigemizu.heat.evolve`.
    diffusivity : float, m2 s-1
        Molecular, of heat.
    held_sides : mapping, optional
        Temperatures [K] of the two walls along "x" or "y", which are insulated otherwise.
    sources : sequence of Source
        What is heated or pushed inside.

    Attributes
    ----------
    u, v, w : (nz + 4, ny + 4, nx + 4) float64, m s-1
        On the left, right (low y) and lower faces, with two cells of padding.
    warmth : (nz + 4, ny + 4, nx + 4) float64, K
        Potential temperature θ = T + Γ z at the centres.

    Notes
    -----
    .. math:: \partial_t u_i + \partial_j (u_j u_i) = -\partial_i \pi + \partial_j [\nu (\partial_j u_i +
              \partial_i u_j)] + g \frac{\theta - \theta_0}{\theta_0} \delta_{i3}, \quad \partial_i u_i = 0
    .. math:: \partial_t \theta + \partial_j (u_j \theta) = \partial_j (\kappa \partial_j \theta)

    with molecular and eddy viscosity ν and diffusivity κ. Finite volumes on a staggered mesh; the momentum by
    averages that conserve its energy, the temperature by limited third-order upwind values (or averages).
    Three stages of Williamson's Runge–Kutta scheme, each made free of divergence to round-off
    (`nigemizu.heat.flow.pressure`): third order in the step, second in the cells. With eddies, what they
    diffuse upwards and downwards is taken implicitly (`nigemizu.heat.flow.softening`).

    Limits: the density varies with the temperature only, by little, and in its weight alone (Boussinesq): for
    differences of some ten kelvin, and layers that are thin against 8 km. No moisture, no Coriolis force.

    References
    ----------
    J. H. Williamson (1980), Low-storage Runge–Kutta schemes, Journal of Computational Physics 35, 48–56,
    doi:10.1016/0021-9991(80)90033-9.
    """

    def __init__(
        self,
        grid: Grid,
        flow: Convection,
        ground: GroundBoundary,
        sides: Sides,
        top: Top,
        diffusivity: float,
        held_sides: dict[str, tuple[float, float]] | None = None,
        sources: Sequence[Source] = (),
    ) -> None:
        self.grid, self.flow, self.diffusivity = grid, flow, diffusivity
        self.workers = processors()
        self._pool: ThreadPoolExecutor | None = None
        self.walls = (sides.x == "insulated", sides.y == "insulated")
        self._held = held_sides or {}
        self.u, self.v, self.w, self.warmth = (padded(grid.shape) for _ in range(4))
        self._increments = [np.zeros(grid.shape) for _ in range(4)]
        self._nu = np.full(self.u.shape, flow.viscosity)
        self._poisson = Poisson(grid, self.walls, self._share, self.workers)
        self._layer = GroundLayer(grid, ground, flow, diffusivity)
        self._release = Release(grid, sources, self.walls)
        self._top = top
        self.top_warmth = math.nan
        self.zero = math.nan
        self.time = 0.0
        # ---- metric
        self._rdx, self._rdy = (1 / grid.horizontal_step(axis) for axis in "xy")
        z = np.pad(grid.z_widths, PAD, mode="symmetric" if len(grid.z) > 1 else "edge")
        self._dz, self._rdz = z, 1 / z
        between = np.empty_like(z)
        between[1:] = 0.5 * (z[1:] + z[:-1])
        between[0] = between[1]
        self._rdzf = np.append(1 / between, 1 / between[-1])

    def __enter__(self) -> MovingAir:
        self._pool = ThreadPoolExecutor(self.workers)
        return self

    def __exit__(self, *_: object) -> None:
        assert self._pool is not None
        self._pool.shutdown()

    # ------------------------------------------------------------------ state
    def set(self, temperature: Any, velocity: Velocity | None = None, time: float = 0.0) -> None:
        """Begin with a temperature (nz, ny, nx) [K] and velocities on the faces, each (nz, ny, nx) [m/s]."""
        self.time = time
        self.warmth[INSIDE] = temperature + (self.flow.lapse_rate * self.grid.z)[:, None, None]
        self._set_zero(float(np.mean(self.warmth[INSIDE])))
        for field, given in zip((self.u, self.v, self.w), () if velocity is None else velocity, strict=False):
            field[INSIDE] = given
        if math.isnan(self.top_warmth):
            self.top_warmth = self._mean_top()
        self._fill()
        self._project()

    def restore(
        self, warmth: Any, velocity: Velocity, *, time: float, zero: float, top_warmth: float
    ) -> None:
        """Go on from a state that was reached before: the next steps are the same to the bit."""
        self.warmth[INSIDE] = warmth
        for field, given in zip((self.u, self.v, self.w), velocity, strict=True):
            field[INSIDE] = given
        self.time, self.top_warmth = time, top_warmth
        self._set_zero(zero)
        self._fill()

    def _set_zero(self, warmth: float) -> None:
        self.zero = warmth
        self._release.set_air(warmth, self.flow.gravity / warmth)

    @property
    def temperature(self) -> np.ndarray:
        """T [K] at the centres, (nz, ny, nx)."""
        lapse = self.flow.lapse_rate * self.grid.z
        return np.asarray(self.warmth[INSIDE] - lapse[:, None, None])

    @property
    def velocity(self) -> Velocity:
        """Velocities on the faces, without padding: what `set` takes."""
        u, v, w = (field[INSIDE].copy() for field in (self.u, self.v, self.w))
        return u, v, w

    def skin_at(self, time: float) -> np.ndarray:
        """Temperature [K] of the air's skin on the ground, (ny, nx)."""
        return np.asarray(self._through_ground(time)[2])

    @property
    def wind(self) -> Velocity:
        """Velocities at the centres [m s-1], each (nz, ny, nx)."""
        middle = slice(PAD, -PAD)
        after = slice(PAD + 1, 1 - PAD)
        return (
            0.5 * (self.u[INSIDE] + self.u[middle, middle, after]),
            0.5 * (self.v[INSIDE] + self.v[middle, after, middle]),
            0.5 * (self.w[INSIDE] + self.w[after, middle, middle]),
        )

    def divergence(self) -> np.ndarray:
        """Of the velocity [1/s] at the centres."""
        result = np.empty(self.grid.shape)
        self._levels(kernels.divergence, self.u, self.v, self.w, result, self._rdx, self._rdy, self._rdz)
        return result

    # ------------------------------------------------------------------ steps
    def longest_step(self) -> float:
        """The step [s] that the scheme bears now; infinite in air at rest that nothing moves."""
        self._update_viscosity()
        flow = self.flow
        lift = flow.gravity / self.zero
        # eddies conduct heat by 1/Pr_t of the viscosity, molecules by what they do
        prandtl = 1 / flow.turbulent_prandtl if flow.closure == "vreman" else 1.0
        largest = max(1.0, prandtl, self.diffusivity / max(flow.viscosity, 1e-300))
        args = (self.u, self.v, self.w, self._nu, self.warmth, lift, largest, flow.closure == "none")
        metric = (self._rdx, self._rdy, self._rdz, self._rdzf)
        found = self._levels(kernels.fastest, *args, *metric)
        crossing, spreading, lifting = np.max(np.array(found), axis=0)
        if flow.viscosity == 0:
            room = 4 * (self._rdx**2 + self._rdy**2 + np.max(self._rdz) ** 2)
            spreading = max(spreading, self.diffusivity * room)
        now = self._bearable(crossing, spreading, lifting, self.time)
        then = self._bearable(crossing, spreading, lifting, self.time + now)
        # up to where the next source starts, unless that is nearer than a step that bears it
        return min(now, max(then, self._release.next_start(self.time) - self.time))

    def first_step(self) -> float:
        """The step [s] that sources bear in air at rest, once they are on; infinite without any."""
        return self._bearable(0.0, 0.0, 0.0, math.inf)

    def _bearable(self, crossing: float, spreading: float, lifting: float, before: float) -> float:
        """The step for these rates [1/s], with sources that start before an instant [s]."""
        pushing, heating = self._release.rates(before)
        courant = self.flow.courant
        # crossing·Δt + pushing·Δt² makes the Courant number; (lifting·Δt)³ + heating·Δt³ the turn
        rate = 0.5 * (crossing + math.sqrt(crossing**2 + 4 * courant * pushing)) / courant
        rate += spreading / _SPREADING + math.cbrt(lifting**3 + heating) / _LIFTING
        return math.inf if rate == 0 else float(1 / rate)

    def advance(self, step: float, mean_wind: tuple[float | None, float | None] = (None, None)) -> None:
        """One step [s], after which the mean wind along x and y is as given (None: as it comes).

        A uniform force, as that of a pressure that falls along the wind, keeps it up against the drag of the
        ground.
        """
        begin = self.time
        for a, b, c in zip(_A, _B, _C, strict=True):
            self._push(a, step, begin + c * step)
            self._release.add(self._increments, begin, step)
            if self.flow.closure == "none":
                self._add(b)
            else:
                self._add_softly(b, b * step)
            self._fill()
            self._project()
        for field, mean in zip((self.u, self.v), mean_wind, strict=True):
            if mean is not None:
                field[INSIDE] += mean - self._mean(field)
        if mean_wind != (None, None):
            self._fill()
        self.time = begin + step

    def _add(self, b: float) -> None:
        skip_x, skip_y = (int(wall) for wall in self.walls)
        skips = ((skip_x, 0, 0), (0, skip_y, 0), (0, 0, 1), (0, 0, 0))
        fields = (self.u, self.v, self.w, self.warmth)
        for field, increment, skip in zip(fields, self._increments, skips, strict=True):
            self._levels(kernels.add, field, increment, b, *skip)

    def _add_softly(self, b: float, time: float) -> None:
        """The same with increments that vertical diffusion has softened."""
        gu, gv, gw, gs = self._increments
        flow, nu, metric = self.flow, self._nu, (self._rdz, self._rdzf)
        skip_x, skip_y = (int(wall) for wall in self.walls)
        drag = 0.0 if self._layer.rough else 2 * flow.viscosity * self._rdz[PAD]
        held = 0.0 if self._layer.rough or not self._layer.holds else 2 * self.diffusivity * self._rdz[PAD]
        momentum_ = (nu, flow.viscosity, 1.0, flow.viscosity, drag)
        heat = (nu, flow.viscosity, 1 / flow.turbulent_prandtl, self.diffusivity, held)
        self._rows(softening.add_softly, self.u, gu, b, time, *momentum_, skip_x, 0, *metric)
        self._rows(softening.add_softly, self.v, gv, b, time, *momentum_, 0, skip_y, *metric)
        self._rows(softening.add_softly_on_faces, self.w, gw, b, time, nu, *metric)
        self._rows(softening.add_softly, self.warmth, gs, b, time, *heat, 0, 0, *metric)

    def _mean(self, field: np.ndarray) -> float:
        levels = field[INSIDE].mean(axis=(1, 2))
        return float(levels @ self.grid.z_widths / np.sum(self.grid.z_widths))

    def _push(self, a: float, dt: float, time: float) -> None:
        """Increments of one stage."""
        u, v, w, s, nu = self.u, self.v, self.w, self.warmth, self._nu
        flow = self.flow
        gu, gv, gw, gs = self._increments
        (low_u, low_v), low_s, _ = self._through_ground(time)
        (high_u, high_v), high_s = self._through_top()
        metric = (self._rdx, self._rdy, self._rdz, self._rdzf)
        self._levels(momentum.push_u, u, v, w, nu, low_u, high_u, gu, a, dt, *metric)
        if self.grid.shape[1] > 1 or self.walls[1] or np.any(v):
            self._levels(momentum.push_v, u, v, w, nu, low_v, high_v, gv, a, dt, *metric)
        vertical = (self._rdx, self._rdy, self._dz, self._rdzf)
        lift = flow.gravity / self.zero
        self._levels(momentum.push_w, u, v, w, nu, s, lift, self.zero, gw, a, dt, *vertical)
        eddies = 1 / flow.turbulent_prandtl if flow.closure == "vreman" else 0.0
        limited = flow.advection == "limited"
        heat = (self.diffusivity, flow.viscosity, eddies, limited)
        self._levels(kernels.push_warmth, u, v, w, s, nu, low_s, high_s, gs, a, dt, *heat, *metric)

    def _through_ground(self, time: float) -> tuple[tuple[Any, Any], Any, Any]:
        """Fluxes of momentum along x and y, and of heat, through the ground, and the air's skin on it."""
        u, v = self.u[PAD], self.v[PAD]
        here = (slice(PAD, -PAD),) * 2
        u_at_v, v_at_u = 0.25 * _around(u, (-1, 0), (0, 1)), 0.25 * _around(v, (0, 1), (-1, 0))
        stresses = self._layer.stresses((u[here], u_at_v), (v[here], v_at_u))
        speed = np.hypot(
            0.5 * (u[here] + u[PAD:-PAD, PAD + 1 : 1 - PAD]), 0.5 * (v[here] + v[PAD + 1 : 1 - PAD, PAD:-PAD])
        )
        return stresses, *self._layer.heat(self.warmth[PAD][here], speed, time, self.zero)

    def _through_top(self) -> tuple[tuple[Any, Any], Any]:
        highest = self.grid.shape[0] + PAD - 1
        inside = (highest, slice(PAD, -PAD), slice(PAD, -PAD))
        half = 0.5 * float(self.grid.z_widths[-1])
        still = np.zeros(self.grid.shape[1:])
        stresses = (still, still)
        if self.flow.top == "no-slip":
            factor = self.flow.viscosity / half
            stresses = (factor * self.u[inside], factor * self.v[inside])
        if self._top.kind == "insulated":
            return stresses, still
        return stresses, self.diffusivity / half * (self.warmth[inside] - self.top_warmth)

    def _mean_top(self) -> float:
        """θ at the top: given, or the mean in the beginning, on the line through the two highest levels."""
        edge = float(self.grid.z_edges[-1])
        if self._top.temperature is not None:
            return self._top.temperature + self.flow.lapse_rate * edge
        return top_temperature(self.grid, self.warmth[INSIDE])

    def _fill(self) -> None:
        """The padding of all fields."""
        slip = 1.0 if self.flow.sides == "free-slip" else -1.0
        below, above = -1.0, 1.0 if self.flow.top == "free-slip" else -1.0
        if self._layer.rough:
            below = 1.0
        for axis, wall, name, normal in ((2, self.walls[0], "x", self.u), (1, self.walls[1], "y", self.v)):
            for field in (self.u, self.v, self.w):
                kind = "periodic" if not wall else "face" if field is normal else "centre"
                pad_sides(field, axis, kind, -1.0 if field is normal else slip)
            held = self._held.get(name)
            pad_sides(
                self.warmth, axis, "centre" if wall else "periodic", 1.0 if held is None else -1.0, held
            )
        pad_ends(self.u, below, above)
        pad_ends(self.v, below, above)
        pad_ends(self.warmth, 1.0, 1.0)
        top = self.grid.shape[0] + PAD
        self.w[PAD] = self.w[top] = 0.0
        for ghost in (1, 2):
            self.w[PAD - ghost] = -self.w[min(PAD + ghost, top)]
        self.w[top + 1] = -self.w[top - 1]

    def _update_viscosity(self) -> None:
        if self.flow.closure == "none":
            return
        args = (self.u, self.v, self.w, self._nu, self.flow.viscosity, self.flow.closure_constant)
        self._levels(kernels.eddy_viscosity, *args, self._rdx, self._rdy, self._dz, self._rdz)
        for axis, wall in ((2, self.walls[0]), (1, self.walls[1])):
            pad_sides(self._nu, axis, "centre" if wall else "periodic", 1.0)
        pad_ends(self._nu, 1.0, 1.0)

    def _project(self) -> None:
        phi = self._poisson.solve(self.divergence())
        wall_x, wall_y = self.walls
        self._levels(
            kernels.correct, self.u, self.v, self.w, phi, wall_x, wall_y, self._rdx, self._rdy, self._rdzf
        )
        self._fill()

    # ------------------------------------------------------------------ sharing of the work
    def _levels(self, kernel: Callable[..., Any], *args: Any) -> list[Any]:
        """Run a compiled loop over all levels, parts of them side by side."""
        results: list[Any] = []
        self._share(lambda first, last: results.append(kernel(first, last, *args)), self.grid.shape[0])
        return results

    def _rows(self, kernel: Callable[..., Any], *args: Any) -> None:
        """The same over all rows along x."""
        self._share(lambda first, last: kernel(first, last, *args), self.grid.shape[1])

    def _share(self, work: Callable[[int, int], None], count: int) -> None:
        parts = min(self.workers, count)
        bounds = np.linspace(0, count, parts + 1).astype(int)
        if self._pool is None or parts == 1:
            work(0, count)
            return
        tasks = [self._pool.submit(work, int(a), int(b)) for a, b in itertools.pairwise(bounds)]
        for task in tasks:
            task.result()


def _around(plane: np.ndarray, rows: tuple[int, int], columns: tuple[int, int]) -> Any:
    """Sum of the four neighbours at these offsets, on the places without padding."""
    height, width = (count - PAD for count in plane.shape)
    return sum(
        plane[PAD + row : height + row, PAD + column : width + column] for row in rows for column in columns
    )
