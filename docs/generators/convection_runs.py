"""Flows on several meshes for the page on convection: ``make validation`` writes ``data/convection.json``."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np

from generators.flows import cavity_on, growth, rolls_on
from nigemizu.heat import Convection, FluxGround, GridSpec, HeldGround, Quantity, Sides, Top
from nigemizu.heat.flow.moving import MovingAir

__all__ = ["DATA"]

DATA = Path(__file__).resolve().parents[1] / "data" / "convection.json"

SIGNIFICANT = 8
GROWTH = (1500.0, 1650.0, 1800.0, 2200.0)
"""Rayleigh numbers at which small rolls fade or grow."""

LEVELS = (10, 20)
ROLLS = (6, 12, 24)
CAVITIES = {1e4: ((8, 16, 32), 0.35), 1e5: ((14, 28, 56), 0.2)}
"""Rayleigh number: cells along a side, and time until it is steady."""


def main() -> None:
    rolls = [rolls_on(1e4, count) for count in ROLLS]
    cavities = {number: [cavity_on(number, count, time) for count in counts]
                for number, (counts, time) in CAVITIES.items()}  # fmt: skip
    data = {
        "version": version("nigemizu"),
        "levels": LEVELS,
        "growth": [[number, *(_short(growth(number, count)) for count in LEVELS)] for number in GROWTH],
        "rolls": {"levels": ROLLS, "nusselt": [_short(value) for value, _ in rolls]},
        "cavities": [
            {
                "rayleigh": number,
                "cells": CAVITIES[number][0],
                "nusselt": [_short(value) for value, _ in runs],
            }
            for number, runs in cavities.items()
        ],
        "kept": _kept(),
        "shown": {"rolls": _rounded(rolls[-1][1]), "cavity": _rounded(cavities[1e5][1][1])},
    }
    DATA.write_text(json.dumps(data, separators=(",", ":")) + "\n", encoding="utf-8")


def _kept() -> dict[str, float]:
    """What remains of divergence, heat and energy where nothing may be lost."""
    return {
        "divergence": _divergence(),
        "heat": _heat(),
        "energy": [_energy(steps) for steps in (16, 32, 64)],
    }


def _stirred(flow: Convection, ground: HeldGround | FluxGround, diffusivity: float) -> MovingAir:
    grid = GridSpec(x=(0, 3), y=(0, 2), height=1.0, cells=(12, 10, 14), first_cell=0.05).build()
    air = MovingAir(grid, flow, ground, Sides(), Top(kind="insulated"), diffusivity)
    random = np.random.default_rng(np.random.SeedSequence(3))
    air.set(300 + random.standard_normal(grid.shape), 0.3 * random.standard_normal((3, *grid.shape)))
    return air


def _divergence() -> float:
    """Largest divergence after three steps, in units of the largest velocity over the smallest cell."""
    with _stirred(Convection(noise=0.0), HeldGround(temperature=Quantity(value=310.0)), 2.2e-5) as air:
        for _ in range(3):
            air.advance(air.longest_step())
        largest = max(float(np.max(np.abs(part))) for part in air.velocity) / float(np.min(air.grid.z_widths))
        return _short(float(np.max(np.abs(air.divergence()))) / largest)


def _heat() -> float:
    """Heat gained by an insulated box in ten steps, less what came through the ground, over what it holds."""
    ground = FluxGround(heat_flux=Quantity(value=200.0))
    with _stirred(Convection(noise=0.0), ground, 2.2e-5) as air:
        before = float(np.sum(air.warmth * air.grid.volumes))
        for _ in range(10):
            air.advance(air.longest_step())
        gained = float(np.sum(air.warmth * air.grid.volumes)) - before
        return _short((gained - 200.0 / ground.heat_capacity * 6.0 * air.time) / before)


def _energy(steps: int) -> float:
    """Share of the energy that inviscid air loses in 0.3 s."""
    still = Convection(
        viscosity=0.0, closure="none", gravity=0.0, lapse_rate=0.0, advection="central", noise=0.0
    )
    with _stirred(still, HeldGround(temperature=Quantity(value=310.0)), 0.0) as air:
        before = _energy_of(air)
        for _ in range(steps):
            air.advance(0.3 / steps)
        return _short(1 - _energy_of(air) / before)


def _energy_of(air: MovingAir) -> float:
    dz, (u, v, w) = air.grid.z_widths, air.velocity
    of_faces = np.concatenate([[0.0], 0.5 * (dz[1:] + dz[:-1])])
    return float(np.sum((u * u + v * v) * dz[:, None, None]) + np.sum(w * w * of_faces[:, None, None]))


def _short(value: float) -> float:
    return float(f"{value:.{SIGNIFICANT}g}")


def _rounded(field: np.ndarray) -> list[list[float]]:
    return [[round(float(value), 3) for value in row] for row in field]


if __name__ == "__main__":
    main()
