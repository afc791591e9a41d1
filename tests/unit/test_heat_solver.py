"""The solver as it is called: instants, copies, progress, refusals."""

import math
import subprocess
import sys

import numpy as np
import pytest

from nigemizu.errors import InputError
from nigemizu.heat import (
    Diffusivity,
    ExchangeGround,
    FluxGround,
    GridSpec,
    HeldGround,
    Quantity,
    Schedule,
    Stripes,
    Top,
    Wind,
    evolve,
    solve,
)
from nigemizu.heat.horizontal import carry_weights, spreading_kernel
from nigemizu.heat.solver import choose_time_step
from nigemizu.progress import ProgressMeter

GRID = GridSpec(x=(0, 8), y=(0, 4), height=1.0, cells=(8, 4, 10), first_cell=0.02).build()
AIR = np.full(GRID.shape, 300.0)
WARM = HeldGround(temperature=320)


class Meter(ProgressMeter):
    def __init__(self):
        self.events = []

    def start(self, label, total):
        self.events.append(("start", label, total))

    def advance(self, amount=1):
        self.events.append(("advance", amount))

    def finish(self):
        self.events.append(("finish",))


def test_states_come_at_the_wanted_times_with_arrays_of_their_own():
    air = AIR.copy()
    states = list(evolve(GRID, air, ground=WARM, times=[0.0, 0.1, 0.3, 0.7], time_step=0.15))
    assert [state.time for state in states] == [0.0, 0.1, 0.3, 0.7]
    np.testing.assert_array_equal(states[0].temperature, air)
    assert np.all(np.diff([state.temperature[0].mean() for state in states]) > 0)
    assert all(state.surface_temperature.shape == (4, 8) for state in states)
    np.testing.assert_array_equal(air, AIR)
    states[1].temperature[:] = 0  # whoever changes one does not change the next
    assert states[2].temperature.min() >= 300 - 1e-9


def test_progress_counts_the_steps():
    meter = Meter()
    list(evolve(GRID, AIR, ground=WARM, times=[0.0, 0.1, 0.5], time_step=0.15, progress=meter))
    assert meter.events == [("start", "heat", 4), *[("advance", 1)] * 4, ("finish",)]


def test_a_later_start():
    ground = HeldGround(temperature=Quantity(schedule=Schedule(times=(0, 100), values=(300, 400))))
    (state,) = evolve(GRID, AIR, ground=ground, times=[60.0], start=50.0)
    np.testing.assert_allclose(state.surface_temperature, 360.0)


def test_pattern_of_the_ground_reaches_the_air():
    ground = HeldGround(temperature=Quantity(value=300, patterns=(Stripes(width=4.0, offsets=(0, 30)),)))
    (state,) = evolve(GRID, AIR, ground=ground, times=[20.0])
    np.testing.assert_allclose(state.surface_temperature[0], [300] * 4 + [330] * 4)
    lowest = state.temperature[0, 0]
    assert lowest[:3] == pytest.approx(300, abs=0.1)
    assert lowest[5:7].min() > 309


def test_automatic_step():
    calm = {"ground": WARM, "diffusivity": Diffusivity(), "wind": Wind()}
    assert choose_time_step(GRID, **calm) == math.inf
    assert choose_time_step(GRID, **{**calm, "wind": Wind(speed=4.0)}) == pytest.approx(0.5)
    table = HeldGround(temperature=Quantity(schedule=Schedule(times=(0, 3, 5), values=(300, 301, 302))))
    assert choose_time_step(GRID, **{**calm, "ground": table}) == 2.0
    exchange = ExchangeGround(coefficient=table.temperature, temperature=300)
    assert choose_time_step(GRID, **{**calm, "ground": exchange}) == 2.0 / 8
    eddies = Diffusivity(kind="eddy", friction_velocity=1.0, cap_height=10.0, horizontal_factor=100.0)
    highest = 100 * float(eddies.vertical(GRID.z[-1]))
    assert choose_time_step(GRID, **{**calm, "diffusivity": eddies}) == pytest.approx(4 / highest)


def test_top_stays_at_what_it_was():
    air = np.broadcast_to((300 + 10 * GRID.z)[:, None, None], GRID.shape)
    (state,) = evolve(GRID, air, ground=HeldGround(temperature=300), times=[1e7])
    np.testing.assert_allclose(state.temperature[:, 0, 0], 300 + 10 * GRID.z, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"times": []}, "no times"),
        ({"times": [1.0, 1.0]}, "times must increase"),
        ({"times": [-1.0]}, "times must increase from 0 s on"),
        ({"times": [math.nan]}, "finite"),
        ({"time_step": 0.0}, r"time\.step: the time step must be above zero"),
        ({"time_step": math.nan}, "time step"),
        ({"temperature": np.zeros((2, 2, 2))}, r"does not fit the grid.*\(10, 4, 8\)"),
        ({"temperature": AIR - 300}, "above 0 K"),
        ({"temperature": np.where(AIR > 0, np.nan, 0)}, "above 0 K"),
        ({"available": lambda: 1000}, r"grid\.cells.*available"),
    ],
)
def test_what_is_refused(change, words):
    arguments = {"temperature": AIR, "ground": WARM, "times": [1.0], **change}
    with pytest.raises(InputError, match=words):
        evolve(GRID, **arguments)  # at the call, before the first state is asked for


def test_air_that_freezes_is_refused():
    with pytest.raises(InputError, match="cools below 0 K"):
        list(evolve(GRID, AIR, ground=FluxGround(heat_flux=-1e4), top=Top(kind="insulated"), times=[100.0]))


def test_solve_collects_a_dataset():
    data = solve(GRID, AIR, ground=WARM, times=[0.0, 1.0])
    assert dict(data.air_temperature.sizes) == {"time": 2, "z": 10, "y": 4, "x": 8}
    (state,) = evolve(GRID, AIR, ground=WARM, times=[1.0])
    np.testing.assert_array_equal(data.air_temperature.values[1], state.temperature)
    np.testing.assert_array_equal(data.surface_temperature.values[1], state.surface_temperature)


@pytest.mark.parametrize("courant", [0.01, 0.3, 0.5, 0.99])
def test_carried_value_is_exact_for_quartics(courant):
    # means over cells of x^p are carried exactly: the mean of x^p over the piece upwind of the face at 0
    weights = carry_weights(np.array([courant]))[0]
    left = np.arange(-3.0, 2.0)
    for power in range(5):
        means = ((left + 1) ** (power + 1) - left ** (power + 1)) / (power + 1)
        exact = -((-courant) ** (power + 1)) / (power + 1) / courant
        assert weights @ means == pytest.approx(exact, abs=1e-11)


@pytest.mark.parametrize(("number", "count"), [(0.25, 16), (30.0, 16), (1e6, 9), (1e-5, 64), (2.0, 2)])
@pytest.mark.parametrize("periodic", [True, False])
def test_spreading_kernel_is_a_positive_mean_with_the_right_width(number, count, periodic):
    kernel = spreading_kernel(number, count, periodic)
    assert kernel.min() >= 0
    assert kernel[0] + 2 * kernel[1:].sum() == pytest.approx(1, abs=1e-15)
    # the discrete Fourier multiplier of the longest wave, exp(-4 r sin²(π/N))
    period = count if periodic else 2 * count
    places = np.arange(1, kernel.size)
    multiplier = kernel[0] + 2 * np.sum(kernel[1:] * np.cos(2 * np.pi * places / period))
    assert multiplier == pytest.approx(math.exp(-4 * number * math.sin(math.pi / period) ** 2), abs=1e-14)


def test_values_are_imported_without_the_compiler_or_the_readers():
    code = (
        "import sys; from nigemizu.heat import GridSpec, HeldGround, Initial, Wind, Diffusivity;"
        "print([name for name in ('numba', 'xarray', 'scipy', 'PIL') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
