"""Flows for the validation page: steady rolls and the heated cavity, extrapolated from two meshes each."""

from __future__ import annotations

import numpy as np

from nigemizu.heat import Convection, FluxGround, GridSpec, HeldGround, Quantity, Sides, Top
from nigemizu.heat.flow.moving import MovingAir

__all__ = ["CRITICAL_NUMBER", "cavity", "cavity_on", "growth", "rolls", "rolls_on"]

PRANDTL, DIFFUSIVITY = 0.71, 1e-3
WARM, COLD, MEAN = 300.5, 299.5, 300.0
CRITICAL_NUMBER = 3.116323554821122
"""Wave number of the first rolls between rigid plates, in units of 1/height (Chandrasekhar 1961)."""


def rolls(rayleigh: float) -> float:
    """Nusselt number of steady rolls of the wavelength 2π/3.117 between rigid plates."""
    return _extrapolated(lambda count: rolls_on(rayleigh, count)[0], 12)


def cavity(rayleigh: float) -> float:
    """Mean Nusselt number of the square cavity with warm and cold side walls."""
    return _extrapolated(lambda count: cavity_on(rayleigh, count, 0.35)[0], 16)


def _extrapolated(measure, count):  # type: ignore[no-untyped-def]
    coarse, fine = measure(count), measure(2 * count)
    return fine + (fine - coarse) / 3


def _laboratory(rayleigh: float) -> Convection:
    viscosity = PRANDTL * DIFFUSIVITY
    return Convection(
        viscosity=viscosity, closure="none", top="no-slip", sides="no-slip", lapse_rate=0.0, noise=0.0,
        gravity=rayleigh * MEAN * viscosity * DIFFUSIVITY, advection="central",
    )  # fmt: skip


def _layer(rayleigh: float, count: int, length: float) -> tuple[MovingAir, np.ndarray]:
    """A layer heated from below, and a roll of 1 K that fits into it."""
    grid = GridSpec(x=(0, length), y=(0, 1), height=1.0, cells=(2 * count, 1, count)).build()
    ground = HeldGround(temperature=Quantity(value=WARM))
    air = MovingAir(grid, _laboratory(rayleigh), ground, Sides(), Top(temperature=COLD), DIFFUSIVITY)
    return air, np.sin(np.pi * grid.z)[:, None, None] * np.cos(2 * np.pi * grid.x / length)


def growth(rayleigh: float, count: int, time: float = 0.6) -> float:
    """Growth rate of a small roll of the critical wavelength on `count` levels [diffusivity / height²]."""
    air, roll = _layer(rayleigh, count, 2 * np.pi / CRITICAL_NUMBER)
    sizes = []
    with air:
        air.set((WARM - air.grid.z)[:, None, None] + 1e-4 * roll)
        for end in (time / 2, time):
            while air.time * DIFFUSIVITY < end * (1 - 1e-12):
                air.advance(min(air.longest_step(), end / DIFFUSIVITY - air.time))
            sizes.append(np.max(np.abs(air.velocity[2])))
    return float(np.log(sizes[1] / sizes[0]) / (time / 2))


def rolls_on(rayleigh: float, count: int) -> tuple[float, np.ndarray]:
    """Nusselt number and temperatures [K] of steady rolls on `count` levels."""
    air, roll = _layer(rayleigh, count, 2 * np.pi / 3.117)
    _run(air, (WARM - air.grid.z)[:, None, None] + 0.1 * roll, 1.0)
    return float((WARM - air.temperature[0].mean()) / (0.5 / count)), air.temperature[:, 0]


def cavity_on(rayleigh: float, count: int, time: float) -> tuple[float, np.ndarray]:
    """Nusselt number and temperatures [K] of the heated cavity on `count`² cells, after `time`."""
    grid = GridSpec(x=(0, 1), y=(0, 1), height=1.0, cells=(count, 1, count)).build()
    ground, sides, top = (
        FluxGround(heat_flux=Quantity(value=0.0)),
        Sides(x="insulated"),
        Top(kind="insulated"),
    )
    air = MovingAir(grid, _laboratory(rayleigh), ground, sides, top, DIFFUSIVITY, {"x": (WARM, COLD)})
    _run(air, (WARM - grid.x) * np.ones(grid.shape), time)
    return float((WARM - air.temperature[:, 0, 0].mean()) / (0.5 / count)), air.temperature[:, 0]


def _run(air: MovingAir, temperature: np.ndarray, time: float) -> None:
    with air:
        air.set(temperature)
        while air.time * DIFFUSIVITY < time:
            air.advance(air.longest_step())
