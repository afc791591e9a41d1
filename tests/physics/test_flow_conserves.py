"""What moving air keeps: its volume, its heat, its energy, and the range of its temperature."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from nigemizu.heat import Convection, FluxGround, GridSpec, HeldGround, Quantity, Sides, Top
from nigemizu.heat.flow.moving import MovingAir

HELD = HeldGround(temperature=Quantity(value=310.0))
STILL = Convection(viscosity=0.0, closure="none", gravity=0.0, lapse_rate=0.0, advection="central", noise=0)


def mesh(cells=(12, 10, 14), first_cell=0.02):
    return GridSpec(x=(0, 3), y=(0, 2), height=1.0, cells=cells, first_cell=first_cell).build()


def stirred(grid, flow, *, sides=None, ground=HELD, top=None, diffusivity=0.0, seed=3):
    """Air with random velocities of some 0.3 m/s, and its temperature."""
    air = MovingAir(grid, flow, ground, sides or Sides(), top or Top(kind="insulated"), diffusivity)
    random = np.random.default_rng(np.random.SeedSequence(seed))
    velocity = 0.3 * random.standard_normal((3, *grid.shape))
    temperature = 300 + random.standard_normal(grid.shape)
    return air, temperature, velocity


def energy(air):
    """Σ V u²/2 with the volume of each face."""
    dz, u, v, w = air.grid.z_widths, *air.velocity
    of_faces = np.concatenate([[0.0], 0.5 * (dz[1:] + dz[:-1])])
    return 0.5 * float(np.sum((u * u + v * v) * dz[:, None, None]) + np.sum(w * w * of_faces[:, None, None]))


@pytest.mark.parametrize("kinds", list(itertools.product(["periodic", "insulated"], repeat=2)))
def test_velocity_has_no_divergence(kinds):
    """Rationale: the operator that is inverted is the divergence of the gradient that is subtracted.

    Expected: round-off, 1e-13 of the divergence before; on stretched cells, with all kinds of sides.
    """
    grid = mesh()
    air, temperature, velocity = stirred(grid, Convection(noise=0), sides=Sides(x=kinds[0], y=kinds[1]))
    with air:
        air.set(temperature, velocity)
        for _ in range(3):
            air.advance(air.longest_step())
        largest = max(np.max(np.abs(part)) for part in air.velocity) / np.min(grid.z_widths)
        assert np.max(np.abs(air.divergence())) < 1e-13 * largest
        assert np.max(np.abs(air.velocity[2])) > 1e-3


def test_heat_is_conserved():
    """An insulated box with a given flux holds what it had and what came in, to round-off."""
    grid, flux = mesh(), 200.0
    ground = FluxGround(heat_flux=Quantity(value=flux))
    air, temperature, velocity = stirred(grid, Convection(noise=0), ground=ground, diffusivity=2.2e-5)
    with air:
        air.set(temperature, velocity)
        before = np.sum(air.warmth * grid.volumes)
        for _ in range(10):
            air.advance(air.longest_step())
        gained = np.sum(air.warmth * grid.volumes) - before
    expected = flux / ground.heat_capacity * 3 * 2 * air.time
    assert abs(gained - expected) < 1e-12 * before
    assert expected > 1e-8 * before


def test_temperature_gets_no_new_extremes():
    """Limited fluxes; negative control: averages overshoot by more than a tenth of a kelvin."""
    grid = mesh()
    beyond = {}
    for advection in ("limited", "central"):
        flow = STILL.model_copy(update={"advection": advection, "courant": 0.5})
        air, temperature, velocity = stirred(grid, flow)
        temperature = np.where(temperature > 300.5, 301.0, 300.0)
        with air:
            air.set(temperature, velocity)
            for _ in range(40):
                air.advance(air.longest_step())
            beyond[advection] = max(np.max(air.temperature) - 301.0, 300.0 - np.min(air.temperature))
    assert beyond["limited"] < 1e-3
    assert beyond["central"] > 0.1


def test_energy_is_lost_by_the_steps_alone():
    """Rationale: averages that preserve symmetry do no work (Verstappen and Veldman 2003).

    Expected: without viscosity the energy changes with the third power of the step, by an exponent within
    0.3 of 3, on stretched cells; negative control: with viscosity it falls, whatever the step.
    """
    grid = mesh(first_cell=0.05)
    lost = {}
    for viscosity, steps in itertools.product((0.0, 1e-4), (32, 64)):
        flow = STILL.model_copy(update={"viscosity": viscosity})
        air, temperature, velocity = stirred(grid, flow)
        with air:
            air.set(temperature, velocity)
            before = energy(air)
            for _ in range(steps):
                air.advance(0.3 / steps)
            lost[viscosity, steps] = 1 - energy(air) / before
    order = np.log2(lost[0.0, 32] / lost[0.0, 64])
    assert 2.7 < order < 3.3
    assert 0 < lost[0.0, 64] < 1e-4
    assert lost[1e-4, 64] > 10 * lost[0.0, 64]
    assert abs(lost[1e-4, 32] / lost[1e-4, 64] - 1) < 0.05


@pytest.mark.parametrize("plane", ["xy", "xz"])
def test_a_steady_vortex_stays(plane):
    """Rationale: ψ = sin kx sin kz is a steady flow without viscosity: what changes is the cells' error.

    Expected: second order, an exponent within 0.2 of 2.
    """
    errors = []
    for count in (16, 32):
        cells = (count, count, 2) if plane == "xy" else (count, 1, count)
        box = {"x": (0, 2), "y": (0, 2)} if plane == "xy" else {"x": (0, 2), "y": (0, 1)}
        grid = GridSpec(**box, height=1.0, cells=cells).build()
        air = MovingAir(grid, STILL, HELD, Sides(), Top(kind="insulated"), 0.0)
        x, y, z = grid.x_edges[:-1], grid.y_edges[:-1], grid.z_edges[:-1]
        velocity = [np.zeros(grid.shape) for _ in range(3)]
        if plane == "xy":
            velocity[0][:] = np.sin(np.pi * x) * np.cos(np.pi * grid.y)[:, None]
            velocity[1][:] = -np.cos(np.pi * grid.x) * np.sin(np.pi * y)[:, None]
        else:
            velocity[0][:] = np.sin(np.pi * x) * np.cos(np.pi * grid.z)[:, None, None]
            velocity[2][:] = -np.cos(np.pi * grid.x) * np.sin(np.pi * z)[:, None, None]
        # a little off the vortex: the wave that it carries along is what the cells have to resolve
        with air:
            air.set(np.full(grid.shape, 300.0), tuple(velocity))
            u, v, w = air.velocity
            air.cells.put((u + 0.25, v, w), air.warmth)
            for _ in range(160):
                air.advance(1.0 / 160)
            moved = 0.25
            if plane == "xy":
                exact = (
                    0.25
                    + np.sin(np.pi * (x - moved)) * np.cos(np.pi * grid.y)[:, None]
                    + 0 * grid.z[:, None, None]
                )
            else:
                exact = 0.25 + np.sin(np.pi * (x - moved)) * np.cos(np.pi * grid.z)[:, None, None]
            errors.append(np.sqrt(np.mean((air.velocity[0] - exact) ** 2)))
    order = np.log2(errors[0] / errors[1])
    assert 1.8 < order < 2.2
    assert errors[1] < 0.02
