"""What a person chooses about air that moves by itself."""

from __future__ import annotations

from typing import Final, Literal, final

from pydantic import Field

from nigemizu.heat.measures import KelvinDifference, Metres, Seconds, SquareMetresPerSecond
from nigemizu.values import Value

__all__ = ["VOLUMES", "Convection"]

VOLUMES: Final = 18
"""Volumes of float64 that are held at most: fields, increments, viscosity, transforms, a state."""


@final
class Convection(Value):
    """How the air flows when ``process = "convection"``.

    Parameters
    ----------
    viscosity : float, m2 s-1
        Kinematic; 1.57e-5 in air at 300 K.
    closure : {"vreman", "none"}
        What stands for eddies that the cells cannot hold: the eddy viscosity of Vreman, which vanishes in
        laminar shear and at walls; or nothing, for flows that the cells resolve.
    closure_constant : float
        Of Vreman's model; 2.5 times the square of Smagorinsky's.
    turbulent_prandtl : float
        Eddy viscosity over eddy diffusivity.
    ground : {"smooth", "rough"}
        ``smooth``: the air sticks to the ground, and molecules carry heat and momentum through the lower half
        of the lowest cell, which has to be as thin as that. ``rough``: laws of the wall for cells that are
        thicker (`nigemizu.heat.flow.ground`).
    roughness : float, m
        Roughness length of ``rough``.
    top, sides : {"free-slip", "no-slip"}
        Whether the air slips along the top, and along sides that are insulated.
    advection : {"limited", "central"}
        How temperature is carried: without new extremes, or without any numerical diffusion.
    courant : float
        Cells that the air may cross in a step, summed over the axes; stable up to 1.7.
    gravity : float, m s-2
    lapse_rate : float, K m-1
        By which air cools that rises without exchanging heat.
    noise : float, K
        Standard deviation of the disturbance of each cell from which the flow develops.
    seed : int
        Of the disturbance.
    checkpoint_every : float, s, optional
        Simulated time between checkpoints, from which ``nigemizu simulate`` goes on after an interruption;
        by default a twentieth of ``time.duration``.

    References
    ----------
    A. W. Vreman (2004), An eddy-viscosity subgrid-scale model for turbulent shear flow, Physics of Fluids 16,
    3670–3681, doi:10.1063/1.1785131.
    """

    viscosity: SquareMetresPerSecond = Field(default=1.57e-5, ge=0)
    closure: Literal["vreman", "none"] = "vreman"
    closure_constant: float = Field(default=0.07, ge=0, le=0.5)
    turbulent_prandtl: float = Field(default=0.4, gt=0)
    ground: Literal["smooth", "rough"] = "smooth"
    roughness: Metres = Field(default=0.001, gt=0)
    top: Literal["free-slip", "no-slip"] = "free-slip"
    sides: Literal["free-slip", "no-slip"] = "free-slip"
    advection: Literal["limited", "central"] = "limited"
    courant: float = Field(default=1.0, gt=0, le=1.7)
    gravity: float = Field(default=9.80665, ge=0, json_schema_extra={"unit": "m/s2"})
    lapse_rate: float = Field(default=9.76e-3, ge=0, json_schema_extra={"unit": "K/m"})
    noise: KelvinDifference = Field(default=0.01, ge=0)
    seed: int = Field(default=0, ge=0)
    checkpoint_every: Seconds | None = Field(default=None, gt=0)
