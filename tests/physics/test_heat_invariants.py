"""What must hold for every input: heat is conserved, nothing new is hotter or colder, steps may be huge."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nigemizu.heat import (
    Diffusivity,
    ExchangeGround,
    FluxGround,
    GridSpec,
    HeldGround,
    Quantity,
    Schedule,
    Sides,
    Top,
    Wind,
    evolve,
)

EDDIES = Diffusivity(kind="eddy", friction_velocity=0.3, cap_height=1.0, horizontal_factor=(3.0, 0.5))
SHEAR = Wind(shear="log", speed=2.0, direction=35.0)


def box(cells=(12, 9, 8), first_cell=0.012):
    return GridSpec(x=(0, 6), y=(0, 3), height=0.5, cells=cells, first_cell=first_cell).build()


def rough(grid, seed=0, spread=40.0):
    return 300 + spread * (np.random.default_rng(seed).random(grid.shape) - 0.5)


def heat(grid, temperature):
    """Sum of temperature × volume [K m3], added without round-off."""
    return math.fsum((grid.volumes * temperature).ravel())


def last(grid, initial, time, **setting):
    *_, state = evolve(grid, initial, times=[time], **setting)
    return state


@pytest.mark.parametrize("step", [0.01, 0.37, 50.0])
def test_heat_is_conserved_between_insulated_walls(step):
    grid = box()
    initial = rough(grid)
    state = last(
        grid, initial, 20 * step, ground=FluxGround(heat_flux=0.0), top=Top(kind="insulated"),
        diffusivity=EDDIES, wind=SHEAR, time_step=step,
    )  # fmt: skip
    before = heat(grid, initial)
    # 20 steps of 5 passes with sums of some 20 terms: 1e-15 each, mostly cancelling
    assert abs(heat(grid, state.temperature) - before) < 1e-14 * before
    assert np.std(state.temperature) < 0.9 * np.std(initial)  # and yet it was mixed


def test_heat_is_conserved_between_insulated_sides():
    grid = box()
    initial = rough(grid)
    state = last(
        grid, initial, 5.0, ground=FluxGround(heat_flux=0.0), top=Top(kind="insulated"),
        diffusivity=EDDIES, sides=Sides(x="insulated", y="insulated"), time_step=0.5,
    )  # fmt: skip
    before = heat(grid, initial)
    assert abs(heat(grid, state.temperature) - before) < 1e-14 * before


@pytest.mark.parametrize("flux", [150.0, -20.0])
def test_flux_adds_exactly_its_heat(flux):
    grid = box()
    initial, time = rough(grid), 12.0
    ground = FluxGround(heat_flux=flux, density=1.1, specific_heat=1010.0)
    state = last(
        grid, initial, time, ground=ground, top=Top(kind="insulated"), diffusivity=EDDIES, wind=SHEAR,
        time_step=0.7,
    )  # fmt: skip
    gained = (heat(grid, state.temperature) - heat(grid, initial)) * 1.1 * 1010.0
    wanted = flux * 18.0 * time  # W m-2 × m2 × s
    assert abs(gained - wanted) < 1e-14 * heat(grid, initial) * 1.1 * 1010.0
    assert abs(gained) > 1000


def test_flux_that_varies_linearly_adds_its_integral():
    grid = box()
    ramp = Quantity(schedule=Schedule(times=(0, 10), values=(0, 100)))
    state = last(
        grid, np.full(grid.shape, 300.0), 10.0, ground=FluxGround(heat_flux=ramp), top=Top(kind="insulated"),
        diffusivity=EDDIES, time_step=3.0,
    )  # fmt: skip
    gained = (heat(grid, state.temperature) - 300.0 * 9.0) * 1.177 * 1006.0
    assert abs(gained - 500.0 * 18.0) < 1e-8


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    step=st.floats(1e-4, 1e5),
    speed=st.floats(0, 50),
    direction=st.floats(-180, 180),
    wall=st.floats(250, 350),
    kind=st.sampled_from(["held", "exchange"]),
    side=st.sampled_from(["periodic", "insulated"]),
    eddies=st.booleans(),
)
def test_no_new_extrema(seed, step, speed, direction, wall, kind, side, eddies):
    grid = box(cells=(7, 6, 5), first_cell=0.04)
    initial = rough(grid, seed)
    ground = (
        HeldGround(temperature=wall) if kind == "held" else ExchangeGround(coefficient=10, temperature=wall)
    )
    state = last(
        grid, initial, 2 * step, ground=ground, top=Top(temperature=310), time_step=step,
        diffusivity=EDDIES if eddies else Diffusivity(), sides=Sides(x=side, y=side),
        wind=Wind(shear="power", speed=speed, direction=direction),
    )  # fmt: skip
    lowest, highest = min(initial.min(), wall, 310), max(initial.max(), wall, 310)
    roundoff = 1e-12
    assert state.temperature.min() >= lowest - roundoff
    assert state.temperature.max() <= highest + roundoff
    assert state.surface_temperature.min() >= lowest - roundoff
    assert state.surface_temperature.max() <= highest + roundoff


def test_huge_steps_in_millimetre_cells_reach_the_steady_state():
    grid = GridSpec(x=(0, 1), y=(0, 1), height=0.05, cells=(2, 2, 50)).build()
    # diffusion number 2.2e-5 · 1e6 / (1 mm)² = 2.2e7
    state = last(
        grid, rough(grid), 1e6, ground=HeldGround(temperature=340), top=Top(temperature=300), time_step=1e6
    )
    expected = np.broadcast_to((340 - 800 * grid.z)[:, None, None], grid.shape)
    np.testing.assert_allclose(state.temperature, expected, atol=1e-7)


def test_stepped_wall_does_not_ring():
    # Crank-Nicolson overshoots here by kelvins; the profile must fall from the wall and never rise
    grid = GridSpec(x=(0, 1), y=(0, 1), height=0.2, cells=(1, 1, 60), first_cell=0.001).build()
    states = evolve(
        grid,
        np.full(grid.shape, 300.0),
        ground=HeldGround(temperature=340),
        times=[10, 20, 40],
        time_step=10.0,
    )
    for state in states:
        assert np.all(np.diff(state.temperature[:, 0, 0]) <= 1e-12)
        assert 300 - 1e-12 <= state.temperature.min() < state.temperature.max() < 340


def test_mirrored_air_stays_mirrored():
    grid = box()
    initial = rough(grid)
    setting = {"ground": HeldGround(temperature=320), "diffusivity": EDDIES, "time_step": 0.2}
    there = last(grid, initial, 1.0, wind=Wind(speed=1.7, direction=20.0), **setting)
    back = last(grid, initial[:, ::-1, ::-1], 1.0, wind=Wind(speed=1.7, direction=200.0), **setting)
    np.testing.assert_allclose(back.temperature[:, ::-1, ::-1], there.temperature, atol=1e-10)


def test_runs_are_identical_to_the_last_bit_and_times_do_not_disturb():
    grid = box()
    setting = {"ground": HeldGround(temperature=320), "diffusivity": EDDIES, "wind": SHEAR}
    first, second = (last(grid, rough(grid), 1.0, **setting) for _ in range(2))
    np.testing.assert_array_equal(first.temperature, second.temperature)
    # in uniform still air the parts do not disturb each other: stopping on the way changes nothing
    still = {"ground": HeldGround(temperature=320), "top": Top(kind="insulated")}
    *_, halted = evolve(grid, rough(grid), times=[0.1, 0.35, 1.0], **still)
    whole = last(grid, rough(grid), 1.0, **still)
    np.testing.assert_allclose(halted.temperature, whole.temperature, atol=1e-11)


@pytest.mark.parametrize("time", [60.0, 300.0])
def test_hot_road_has_the_measured_gradients(time):
    """Asphalt at its hottest: 20-30 K per cm in the first centimetre, 1-2 K per cm above.

    Rationale: measured on an asphalt road at the epoch of maximum temperature (Nature, 1932, "Surface
    convection and the distribution of temperature near a heated surface"; plausibility band).
    """
    grid = GridSpec(x=(0, 1), y=(0, 1), height=2.0, cells=(1, 1, 64), first_cell=0.001).build()
    eddies = Diffusivity(kind="eddy", friction_velocity=0.1, sublayer=0.003, cap_height=1.0)
    air = np.full(grid.shape, 300.0)
    state = last(grid, air, time, ground=HeldGround(temperature=340), diffusivity=eddies)
    heights = np.concatenate([[0.0], grid.z])
    profile = np.concatenate([state.surface_temperature[0], state.temperature[:, 0, 0]])
    at = {height: float(np.interp(height, heights, profile)) for height in (0.0, 0.01, 0.05)}
    assert 20 < at[0.0] - at[0.01] < 30
    assert 1 < (at[0.01] - at[0.05]) / 4 < 2
