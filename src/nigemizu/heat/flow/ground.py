"""What passes through the ground and the top: heat and momentum between a wall and the lowest cells."""

from __future__ import annotations

import math
from typing import Any, Final, final

import numpy as np

from nigemizu.heat.boundary import ExchangeGround, FluxGround, GroundBoundary, HeldGround
from nigemizu.heat.flow.settings import Convection
from nigemizu.heat.grid import Grid
from nigemizu.heat.stepping import GroundCourse
from nigemizu.heat.transport import VON_KARMAN

__all__ = ["GroundLayer"]

FREE: Final = 0.15
"""Of Nu = 0.15 Ra^(1/3), over a warm plate that faces upwards (Lloyd and Moran 1974)."""
OF_HEAT: Final = 0.1
"""Roughness length of heat over that of momentum."""


@final
class GroundLayer:
    r"""Fluxes through the lower face of the lowest cells.

    Parameters
    ----------
    grid : Grid
    ground : GroundBoundary
    flow : Convection
    diffusivity : float, m2 s-1
        Molecular, of heat.

    Notes
    -----
    Smooth ground: :math:`F_u = -\nu u_1 / z_1` and :math:`F_T = \kappa (T_g - T_1)/z_1`, with z₁ half the
    height of the lowest cell.

    Rough ground: :math:`F_u = -C |u_1| u_1`, :math:`C = (k / \ln(z_1/z_0))^2`; heat by
    :math:`F_T = g (T_g - T_1)` with :math:`g^3 = g_f^3 + g_c^3`, the forced part
    :math:`g_f = k^2 |u_1| / (\ln(z_1/z_0) \ln(z_1/z_{0h}))` and, over warmer ground, that of free convection
    :math:`g_c = 0.15\,(g \kappa^2 (T_g - T_1)/(\nu T_0))^{1/3}`. It is at least that of molecules.

    Limits: the rough laws are those of neutral air in the lowest cell, whose height has to lie well above the
    roughness.

    References
    ----------
    J. R. Lloyd, W. R. Moran (1974), Natural convection adjacent to horizontal surface of various planforms,
    Journal of Heat Transfer 96, 443–447, doi:10.1115/1.3450224.
    S. W. Churchill (1977), A comprehensive correlating equation for laminar, assisting, forced and free
    convection, AIChE Journal 23, 10–16, doi:10.1002/aic.690230103, for the sum of cubes.
    """

    def __init__(self, grid: Grid, ground: GroundBoundary, flow: Convection, diffusivity: float) -> None:
        self._course = GroundCourse(grid, ground)
        self._ground, self._flow, self._diffusivity = ground, flow, diffusivity
        self._coefficient = None
        if isinstance(ground, ExchangeGround):
            self._coefficient = ground.coefficient
            self._planes = ground.coefficient.planes(grid)
        self._shape = grid.shape[1:]
        self._half = 0.5 * float(grid.z_widths[0])
        self.rough = flow.ground == "rough"
        self.holds = not isinstance(ground, FluxGround)
        if self.rough:
            self._momentum_log = math.log(self._half / flow.roughness)
            self._heat_log = math.log(self._half / (flow.roughness * OF_HEAT))

    def stresses(self, u: Any, v: Any) -> tuple[Any, Any]:
        """Fluxes of momentum upwards [m2 s-2] on the faces of u and v, of the lowest level (ny, nx) of each
        on its own places and on the other's: ``u`` and ``v`` are pairs (here, there)."""
        if not self.rough:
            factor = self._flow.viscosity / self._half
            return -factor * u[0], -factor * v[0]
        drag = (VON_KARMAN / self._momentum_log) ** 2
        return -drag * np.hypot(u[0], v[1]) * u[0], -drag * np.hypot(u[1], v[0]) * v[0]

    def heat(self, lowest: Any, speed: Any, time: float, warmth: float) -> tuple[Any, Any]:
        """Heat flux upwards [K m s-1] and the temperature of the air's skin [K], both (ny, nx).

        Parameters
        ----------
        lowest : (ny, nx) float64, K
            Temperature of the lowest cells.
        speed : (ny, nx) float64, m s-1
            Of the air in them.
        time : float, s
        warmth : float, K
            Mean temperature of the air.
        """
        plane = np.empty(lowest.size)
        self._course.fill(plane, time)
        plane = plane.reshape(self._shape)
        match self._ground:
            case FluxGround():
                flux = plane / self._ground.heat_capacity
                # the difference that drives the flux decides what it is driven by: a few rounds settle it
                difference = flux * self._half / self._diffusivity
                for _ in range(8 if self.rough else 1):
                    difference = flux / self._conductance(difference, speed, warmth)
                return flux, lowest + difference
            case HeldGround():
                difference = plane - lowest
                return self._conductance(difference, speed, warmth) * difference, plane
            case ExchangeGround():
                factor, summand = self._planes
                assert self._coefficient is not None
                below = (factor * self._coefficient.at_time(time) + summand) / self._ground.heat_capacity
                difference = plane - lowest
                air = self._conductance(difference, speed, warmth)
                flux = air * below / np.maximum(air + below, 1e-300) * difference
                return flux, lowest + flux / air
        raise AssertionError(self._ground)

    def _conductance(self, difference: Any, speed: Any, warmth: float) -> Any:
        """Heat flux per kelvin [m s-1] between the skin and the lowest cells."""
        molecules = self._diffusivity / self._half
        if not self.rough:
            return np.full(self._shape, molecules)
        flow = self._flow
        forced = VON_KARMAN**2 * speed / (self._momentum_log * self._heat_log)
        lift = flow.gravity * self._diffusivity**2 / (max(flow.viscosity, 1e-12) * warmth)
        free = FREE * np.cbrt(lift * np.maximum(difference, 0.0))
        return np.maximum(np.cbrt(forced**3 + free**3), molecules)
