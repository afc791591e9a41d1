"""Moving air: its state, and one step of the equations of Boussinesq."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, final

import numpy as np

from nigemizu.heat.boundary import GroundBoundary, Sides, Top
from nigemizu.heat.flow.cells import INSIDE, Cells, Fluxes, Frame, Velocity
from nigemizu.heat.flow.ground import GroundLayer
from nigemizu.heat.flow.loops import Loops
from nigemizu.heat.flow.padding import PAD, Padding
from nigemizu.heat.flow.settings import Convection
from nigemizu.heat.flow.sources import Release, Source
from nigemizu.heat.grid import Grid
from nigemizu.heat.stepping import top_temperature

__all__ = ["MovingAir"]

_A: Final = (0.0, -5 / 9, -153 / 128)
_B: Final = (1 / 3, 15 / 16, 8 / 15)
_C: Final = (0.0, 1 / 3, 3 / 4)
"""Williamson's Runge–Kutta scheme of third order: G ← A G + Δt N, q ← q + B G at t + C Δt."""
_SPREADING: Final = 2.0  # of 2.51, where the scheme stops being stable on the negative real axis
_LIFTING: Final = 1.0  # radians that internal waves or growing plumes may turn or grow in a step


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
    arrays : nigemizu.field.Types, optional
        Double-precision array types of a device, which does the work instead of the processor's loops.

    Attributes
    ----------
    cells : Cells
        The fields, and the device that they are on.
    time : float, s
    zero : float, K
        The warmth that is neither lighter nor heavier: the mean at the beginning.
    top_warmth : float, K
        Of the top, if that is held.

    Notes
    -----
    .. math:: \partial_t u_i + \partial_j (u_j u_i) = -\partial_i \pi + \partial_j [\nu (\partial_j u_i +
              \partial_i u_j)] + g \frac{\theta - \theta_0}{\theta_0} \delta_{i3}, \quad \partial_i u_i = 0
    .. math:: \partial_t \theta + \partial_j (u_j \theta) = \partial_j (\kappa \partial_j \theta)

    with the potential temperature θ = T + Γ z (here called warmth), molecular and eddy viscosity ν and
    diffusivity κ. Finite volumes on a staggered mesh; the momentum by averages that conserve its energy, the
    temperature by limited third-order upwind values (or averages). Three stages of Williamson's Runge–Kutta
    scheme, each made free of divergence to round-off (`nigemizu.heat.flow.pressure`): third order in the
    step, second in the cells. With eddies, what they diffuse upwards and downwards is taken implicitly
    (`nigemizu.heat.flow.softening`).

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
        held_sides: Mapping[str, tuple[float, float]] | None = None,
        sources: Sequence[Source] = (),
        arrays: Any = None,
    ) -> None:
        self.grid, self.flow, self.diffusivity = grid, flow, diffusivity
        self.walls = (sides.x == "insulated", sides.y == "insulated")
        self._layer = GroundLayer(grid, ground, flow, diffusivity)
        slips = (flow.sides == "free-slip", self._layer.rough, flow.top == "free-slip")
        padding = Padding(self.walls, slips, held_sides or {})
        holds = self._layer.holds and not self._layer.rough
        self.cells = _cells(Frame(grid, flow, padding, self.walls, diffusivity, holds), arrays)
        self._release = Release(grid, sources, self.walls)
        self._top = top
        self.top_warmth = math.nan
        self.zero = math.nan
        self.time = 0.0

    def __enter__(self) -> MovingAir:
        self.cells.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self.cells.__exit__()

    # ------------------------------------------------------------------ state
    def set(self, temperature: Any, velocity: Velocity | None = None, time: float = 0.0) -> None:
        """Begin with a temperature (nz, ny, nx) [K] and velocities on the faces, each (nz, ny, nx) [m/s]."""
        warmth = temperature + (self.flow.lapse_rate * self.grid.z)[:, None, None]
        still = np.zeros(self.grid.shape)
        self.time = time
        self._set_zero(float(np.mean(warmth)))
        if math.isnan(self.top_warmth):
            self.top_warmth = self._mean_top(warmth)
        self.cells.put((still, still, still) if velocity is None else velocity, warmth)
        self.cells.project()

    def restore(
        self, warmth: Any, velocity: Velocity, *, time: float, zero: float, top_warmth: float
    ) -> None:
        """Go on from a state that was reached before: the next steps are the same to the bit."""
        self.cells.put(velocity, warmth)
        self.time, self.top_warmth = time, top_warmth
        self._set_zero(zero)

    def _set_zero(self, warmth: float) -> None:
        self.zero = warmth
        self._release.set_air(warmth, self.flow.gravity / warmth)

    @property
    def warmth(self) -> np.ndarray:
        """Potential temperature θ = T + Γ z [K] at the centres, (nz, ny, nx)."""
        return np.asarray(self.cells.fields[3][INSIDE])

    @property
    def temperature(self) -> np.ndarray:
        """T [K] at the centres, (nz, ny, nx)."""
        lapse = self.flow.lapse_rate * self.grid.z
        return np.asarray(self.warmth - lapse[:, None, None])

    @property
    def velocity(self) -> Velocity:
        """Velocities on the faces, without padding: what `set` takes."""
        u, v, w = (field[INSIDE].copy() for field in self.cells.fields[:3])
        return u, v, w

    def skin_at(self, time: float) -> np.ndarray:
        """Temperature [K] of the air's skin on the ground, (ny, nx)."""
        return self._through_ground(time)[1]

    @property
    def wind(self) -> Velocity:
        """Velocities at the centres [m s-1], each (nz, ny, nx)."""
        middle, after = slice(PAD, -PAD), slice(PAD + 1, 1 - PAD)
        u, v, w, _ = self.cells.fields
        return (
            0.5 * (u[INSIDE] + u[middle, middle, after]),
            0.5 * (v[INSIDE] + v[middle, after, middle]),
            0.5 * (w[INSIDE] + w[after, middle, middle]),
        )

    def divergence(self) -> np.ndarray:
        """Of the velocity [1/s] at the centres."""
        return self.cells.divergence()

    # ------------------------------------------------------------------ steps
    def longest_step(self) -> float:
        """The step [s] that the scheme bears now; infinite in air at rest that nothing moves."""
        flow = self.flow
        lift = flow.gravity / self.zero
        # eddies conduct heat by 1/Pr_t of the viscosity, molecules by what they do
        prandtl = 1 / flow.turbulent_prandtl if flow.closure == "vreman" else 1.0
        largest = max(1.0, prandtl, self.diffusivity / max(flow.viscosity, 1e-300))
        crossing, spreading, lifting = self.cells.rates(lift, largest, flow.closure == "none")
        if flow.viscosity == 0:
            metric = self.cells.metric
            room = 4 * (metric.rdx**2 + metric.rdy**2 + float(np.max(metric.rdz)) ** 2)
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
        begin, cells = self.time, self.cells
        for a, b, c in zip(_A, _B, _C, strict=True):
            low, _ = self._through_ground(begin + c * step)
            cells.push(a, step, low, self._through_top(), self.flow.gravity / self.zero, self.zero)
            cells.release(self._release.during(begin, step))
            cells.add(b, b * step)
            cells.project()
        for axis, mean in enumerate(mean_wind):
            if mean is not None:
                cells.keep_mean(axis, mean)
        self.time = begin + step

    def _through_ground(self, time: float) -> tuple[Fluxes, np.ndarray]:
        """What passes through the ground, and the temperature [K] of the air's skin on it."""
        u, v, warmth = self.cells.level(0)
        here = (slice(PAD, -PAD),) * 2
        u_at_v, v_at_u = 0.25 * _around(u, (-1, 0), (0, 1)), 0.25 * _around(v, (0, 1), (-1, 0))
        stresses = self._layer.stresses((u[here], u_at_v), (v[here], v_at_u))
        speed = np.hypot(
            0.5 * (u[here] + u[PAD:-PAD, PAD + 1 : 1 - PAD]), 0.5 * (v[here] + v[PAD + 1 : 1 - PAD, PAD:-PAD])
        )
        heat, skin = self._layer.heat(warmth[here], speed, time, self.zero)
        return Fluxes(*stresses, heat), np.asarray(skin)

    def _through_top(self) -> Fluxes:
        still = np.zeros(self.grid.shape[1:])
        sticks, held = self.flow.top == "no-slip", self._top.kind != "insulated"
        if not sticks and not held:
            return Fluxes(still, still, still)
        inside = (slice(PAD, -PAD),) * 2
        half = 0.5 * float(self.grid.z_widths[-1])
        u, v, warmth = (plane[inside] for plane in self.cells.level(-1))
        factor = self.flow.viscosity / half
        heat = self.diffusivity / half * (warmth - self.top_warmth) if held else still
        return Fluxes(factor * u, factor * v, heat) if sticks else Fluxes(still, still, heat)

    def _mean_top(self, warmth: np.ndarray) -> float:
        """θ at the top: given, or the mean in the beginning, on the line through the two highest levels."""
        edge = float(self.grid.z_edges[-1])
        if self._top.temperature is not None:
            return self._top.temperature + self.flow.lapse_rate * edge
        return top_temperature(self.grid, warmth)


def _cells(frame: Frame, arrays: Any) -> Cells:
    if arrays is None:
        return Loops(frame)
    from nigemizu.heat.flow.device import DeviceCells

    return DeviceCells(frame, arrays)


def _around(plane: np.ndarray, rows: tuple[int, int], columns: tuple[int, int]) -> Any:
    """Sum of the four neighbours at these offsets, on the places without padding."""
    height, width = (count - PAD for count in plane.shape)
    return sum(
        plane[PAD + row : height + row, PAD + column : width + column] for row in rows for column in columns
    )
