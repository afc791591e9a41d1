"""Flows for the validation page: steady rolls and the heated cavity, extrapolated from two meshes each."""

from __future__ import annotations

import numpy as np

from nigemizu.heat import Convection, FluxGround, GridSpec, HeldGround, Quantity, Sides, Top
from nigemizu.heat.flow.moving import MovingAir

__all__ = ["cavity", "rolls"]

PRANDTL, DIFFUSIVITY = 0.71, 1e-3
WARM, COLD, MEAN = 300.5, 299.5, 300.0


def rolls(rayleigh: float) -> float:
    """Nusselt number of steady rolls of the wavelength 2π/3.117 between rigid plates."""
    return _extrapolated(lambda count: _rolls(rayleigh, count), 12)


def cavity(rayleigh: float) -> float:
    """Mean Nusselt number of the square cavity with warm and cold side walls."""
    return _extrapolated(lambda count: _cavity(rayleigh, count), 16)


def _extrapolated(measure, count):  # type: ignore[no-untyped-def]
    coarse, fine = measure(count), measure(2 * count)
    return fine + (fine - coarse) / 3


def _laboratory(rayleigh: float) -> Convection:
    viscosity = PRANDTL * DIFFUSIVITY
    return Convection(
        viscosity=viscosity, closure="none", top="no-slip", sides="no-slip", lapse_rate=0.0, noise=0.0,
        gravity=rayleigh * MEAN * viscosity * DIFFUSIVITY, advection="central",
    )  # fmt: skip


def _rolls(rayleigh: float, count: int) -> float:
    length = 2 * np.pi / 3.117
    grid = GridSpec(x=(0, length), y=(0, 1), height=1.0, cells=(2 * count, 1, count)).build()
    ground = HeldGround(temperature=Quantity(value=WARM))
    air = MovingAir(grid, _laboratory(rayleigh), ground, Sides(), Top(temperature=COLD), DIFFUSIVITY)
    roll = np.sin(np.pi * grid.z)[:, None, None] * np.cos(2 * np.pi * grid.x / length)
    _run(air, (WARM - grid.z)[:, None, None] + 0.1 * roll, 1.0)
    return float((WARM - air.temperature[0].mean()) / (0.5 / count))


def _cavity(rayleigh: float, count: int) -> float:
    grid = GridSpec(x=(0, 1), y=(0, 1), height=1.0, cells=(count, 1, count)).build()
    ground, sides, top = (
        FluxGround(heat_flux=Quantity(value=0.0)),
        Sides(x="insulated"),
        Top(kind="insulated"),
    )
    air = MovingAir(grid, _laboratory(rayleigh), ground, sides, top, DIFFUSIVITY, {"x": (WARM, COLD)})
    _run(air, (WARM - grid.x) * np.ones(grid.shape), 0.35)
    return float((WARM - air.temperature[:, 0, 0].mean()) / (0.5 / count))


def _run(air: MovingAir, temperature: np.ndarray, time: float) -> None:
    with air:
        air.set(temperature)
        while air.time * DIFFUSIVITY < time:
            air.advance(air.longest_step())
