"""Orders of convergence of the heat stage: errors halve fourfold when cells or steps are halved."""

import itertools
import math

import numpy as np
import pytest
from scipy.special import erfc

from nigemizu.heat import (
    Daily,
    Diffusivity,
    ExchangeGround,
    FluxGround,
    Grid,
    GridSpec,
    HeldGround,
    Quantity,
    Top,
    Wind,
    evolve,
)

ALPHA = 2.2e-5
CLOSED = {"ground": FluxGround(heat_flux=0.0), "top": Top(kind="insulated")}


def slope(sizes, errors):
    """Order of convergence: least-squares slope of log(error) over log(size)."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def last(grid, initial, time, **setting):
    (state,) = evolve(grid, np.broadcast_to(initial, grid.shape), times=[time], **setting)
    return state


def stretched(cells, height=0.3, stretch=3.0):
    """Edges of a smooth map of equal steps: halving the steps refines the same mesh."""
    s = np.linspace(0, 1, cells + 1)
    return Grid(
        np.array([0.0, 1.0]), np.array([0.0, 1.0]), height * np.sinh(stretch * s) / math.sinh(stretch)
    )


def vertical_error(kind, cells):
    """Largest error against the closed form 30 s after a step at the ground, on a stretched mesh."""
    grid, time = stretched(cells), 30.0
    z, root = grid.z, math.sqrt(4 * ALPHA * time)
    if kind == "held":
        ground, exact = HeldGround(temperature=330), 300 + 30 * erfc(z / root)
    elif kind == "flux":
        ground = FluxGround(heat_flux=20.0)
        ierfc = np.exp(-((z / root) ** 2)) / math.sqrt(math.pi) - z / root * erfc(z / root)
        exact = 300 + 20.0 / (ground.heat_capacity * ALPHA) * root * ierfc
    else:
        ground = ExchangeGround(coefficient=2.0, temperature=330)
        h = 2.0 / (ground.heat_capacity * ALPHA)
        tail = np.exp(h * z + h * h * ALPHA * time) * erfc(z / root + h * root / 2)
        exact = 300 + 30 * (erfc(z / root) - tail)
    # the top lies 5.8 lengths sqrt(4 alpha t) away, where erfc is 2e-16
    state = last(grid, 300.0, time, ground=ground, top=Top(kind="held", temperature=300))
    return float(np.sqrt(np.average((state.temperature[:, 0, 0] - exact) ** 2, weights=grid.z_widths)))


@pytest.mark.parametrize("kind", ["held", "flux", "exchange"])
def test_vertical_diffusion_is_second_order_in_the_cells(kind):
    cells = [16, 32, 64, 128]
    assert abs(slope([1 / n for n in cells], [vertical_error(kind, n) for n in cells]) - 2) < 0.2


@pytest.mark.parametrize("kind", ["flux", "exchange"])
def test_surface_temperature_is_second_order_in_the_cells(kind):
    skins = []
    cells = [16, 32, 64, 128]
    for n in cells:
        ground = (
            FluxGround(heat_flux=20.0) if kind == "flux" else ExchangeGround(coefficient=2.0, temperature=330)
        )
        state = last(stretched(n), 300.0, 30.0, ground=ground, top=Top(kind="held", temperature=300))
        skins.append(float(state.surface_temperature[0, 0]))
    k, root = ground.heat_capacity * ALPHA, math.sqrt(ALPHA * 30.0)
    if kind == "flux":
        exact = 300 + 2 * 20.0 * root / (k * math.sqrt(math.pi))
    else:
        exact = 300 + 30 * (1 - math.exp((2.0 / k * root) ** 2) * erfc(2.0 / k * root))
    errors = np.abs(np.array(skins) - exact)
    assert abs(slope([1 / n for n in cells], errors) - 2) < 0.2


@pytest.mark.parametrize("axis", ["x", "y"])
def test_horizontal_diffusion_is_second_order_in_the_cells(axis):
    cells, errors = [16, 32, 64], []
    for n in cells:
        counts = (n, 1, 1) if axis == "x" else (1, n, 1)
        grid = GridSpec(x=(0, 0.1), y=(0, 0.1), height=1.0, cells=counts).build()
        offset = 2 * math.pi * 0.05 / 0.1  # the single cell of the other axis sits in the middle
        wave = np.cos(2 * math.pi * (grid.x + grid.y[:, None]) / 0.1 - offset)
        state = last(grid, 300 + wave, 5.0, **CLOSED)
        exact = math.exp(-ALPHA * (2 * math.pi / 0.1) ** 2 * 5.0)
        errors.append(float(np.max(np.abs(state.temperature[0] - 300 - exact * wave))))
    assert abs(slope([1 / n for n in cells], errors) - 2) < 0.2


def carried_error(cells, carry=None):
    """Mean error of a cosine carried by a quarter of its length, both as means over the cells."""
    grid = GridSpec(x=(0, 1), y=(0, 1), height=1.0, cells=(cells, 1, 1)).build()
    half = math.pi / cells

    def wave(x):
        return np.cos(2 * math.pi * x) * math.sin(half) / half

    steps = math.ceil(0.25 * cells / 0.4)
    if carry is not None:
        moved = carry(wave(grid.x), 0.25 * cells / steps, steps)
    else:
        state = last(
            grid, 300 + wave(grid.x), 0.25, **CLOSED, wind=Wind(speed=1.0), time_step=0.25 / steps,
            diffusivity=Diffusivity(horizontal=0.0),
        )  # fmt: skip
        moved = state.temperature[0, 0] - 300
    return float(np.mean(np.abs(moved - wave(grid.x - 0.25))))


def upwind(wave, courant, steps):
    for _ in range(steps):
        wave = wave - courant * (wave - np.roll(wave, 1))
    return wave


def test_transport_is_better_than_second_order_in_the_cells():
    # The unlimited flux is of fifth order (it carries quartics exactly). The limiter clips the extrema by
    # some h² over a width of some h^(1/2): order 2.5 in the mean.
    cells = [16, 32, 64, 128]
    sizes = [1 / n for n in cells]
    assert abs(slope(sizes, [carried_error(n) for n in cells]) - 2.5) < 0.2
    # the measure tells orders apart
    assert abs(slope(sizes, [carried_error(n, upwind) for n in cells]) - 1) < 0.2


COURSE = HeldGround(temperature=Quantity(daily=Daily(mean=305, amplitude=5, period=8)))


def sheared(step):
    """Uneven air over warm stripes, in sheared wind with eddies: every part works on the others."""
    grid = GridSpec(x=(0, 8), y=(0, 1), height=2.0, cells=(256, 1, 24), first_cell=0.02).build()
    wave = 300 + 3 * np.sin(2 * math.pi * grid.x / 8) * np.exp(-grid.z[:, None, None])
    return last(
        grid, wave, 1.6, ground=COURSE,
        top=Top(kind="insulated"), wind=Wind(shear="power", speed=1.0, exponent=0.5), time_step=step,
        diffusivity=Diffusivity(kind="eddy", friction_velocity=0.5, cap_height=1.0),
    ).temperature  # fmt: skip


def test_splitting_is_second_order_in_the_step():
    steps = [0.4, 0.2, 0.1]
    results = [sheared(step) for step in [*steps, 0.05]]
    # differences of neighbouring resolutions fall like the error itself
    errors = [float(np.mean(np.abs(a - b))) for a, b in itertools.pairwise(results)]
    assert abs(slope(steps, errors) - 2) < 0.2, errors


def test_daily_course_is_second_order_in_the_step():
    grid = stretched(32)
    ground = HeldGround(
        temperature=Quantity(daily=Daily(mean=310, amplitude=20, time_of_maximum=10, period=60))
    )
    steps = [6.0, 3.0, 1.5]
    results = [
        last(grid, 310.0, 48.0, ground=ground, time_step=step).temperature for step in [*steps, 0.75 / 16]
    ]
    errors = [float(np.max(np.abs(result - results[-1]))) for result in results[:-1]]
    assert abs(slope(steps, errors) - 2) < 0.2, errors


def exchange_errors(cells, steps, delay=0.0, measure=np.max):
    """Errors against a fine run with a coefficient and a temperature of the ground that have their courses.

    With a delay of half a step, the middle of a step takes the coefficient of its start.
    """

    def run(step):
        grid = GridSpec(x=(0, 1), y=(0, 1), height=0.3, cells=(1, 1, cells)).build()
        coefficient = Daily(mean=6, amplitude=4, time_of_maximum=10 + delay * step, period=60)
        ground = ExchangeGround(
            coefficient=Quantity(daily=coefficient),
            temperature=Quantity(daily=Daily(mean=320, amplitude=20, time_of_maximum=25, period=60)),
        )
        return last(grid, 310.0, 48.0, ground=ground, time_step=step).temperature

    exact = run(steps[-1] / 16)
    return [float(measure(np.abs(run(step) - exact))) for step in steps]


@pytest.mark.parametrize(("cells", "measure"), [(16, np.max), (48, np.mean)])
def test_coefficient_with_a_course_is_second_order_in_the_step(cells, measure):
    # The lowest of 16 cells relaxes in 8 s. The lowest of 48 relaxes in 0.9 s, faster than a step, and lags
    # behind the coefficient by half a step: there the order shows in the mean over all cells.
    steps = [1.5, 0.75, 0.375]
    errors = exchange_errors(cells, steps, measure=measure)
    assert abs(slope(steps, errors) - 2) < 0.2, errors
    # the coefficient at the start of every step is of first order
    assert abs(slope(steps, exchange_errors(cells, steps, delay=0.5, measure=measure)) - 1) < 0.2
