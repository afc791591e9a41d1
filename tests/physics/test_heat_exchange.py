"""Exchange of heat with a coefficient that varies in place and in time."""

import math

import numpy as np
import pytest
from PIL import Image as Pictures

from nigemizu.heat import (
    Daily,
    Diffusivity,
    ExchangeGround,
    FluxGround,
    GridSpec,
    HeldGround,
    Image,
    Patches,
    Quantity,
    Rectangle,
    Schedule,
    Stripes,
    Top,
    Wind,
    evolve,
)
from nigemizu.heat.columns import LEVELS, ColumnSteps, ExchangeCourse, conductance_levels
from nigemizu.heat.vertical import VerticalDiffusion

EDDIES = Diffusivity(kind="eddy", friction_velocity=0.1, cap_height=1.0, horizontal=0.0)
MOLECULES = Diffusivity(horizontal=0.0)
GRID = GridSpec(x=(0, 8), y=(0, 4), height=1.0, cells=(16, 8, 20), first_cell=0.004).build()
WARM = 330.0


def last(grid, ground, time=60.0, step=6.0, initial=300.0, diffusivity=EDDIES, **setting):
    air = np.broadcast_to(initial, grid.shape)
    *_, state = evolve(
        grid, air, ground=ground, times=[time], time_step=step, diffusivity=diffusivity, **setting
    )
    return state


def exchange(coefficient, temperature=WARM):
    return ExchangeGround(coefficient=coefficient, temperature=temperature)


def day(mean, amplitude):
    return Quantity(daily=Daily(mean=mean, amplitude=amplitude, time_of_maximum=20, period=90))


@pytest.mark.parametrize("kind", ["stripes", "patches"])
def test_columns_of_two_coefficients_are_those_of_two_runs(kind):
    stripes = Stripes(width=4.0, values=(3.0, 40.0))
    patch = Patches(patches=(Rectangle(x=(4, 8), y=(0, 4), offset=37.0),))
    both = last(GRID, exchange(Quantity(value=3.0, patterns=(stripes if kind == "stripes" else patch,))))
    few, many = last(GRID, exchange(3.0)), last(GRID, exchange(40.0))
    for name in ("temperature", "surface_temperature"):
        joined = getattr(both, name)
        np.testing.assert_allclose(joined[..., :8], getattr(few, name)[..., :8], rtol=0, atol=1e-11)
        np.testing.assert_allclose(joined[..., 8:], getattr(many, name)[..., 8:], rtol=0, atol=1e-11)
    assert np.min(np.abs(few.temperature[0] - many.temperature[0])) > 3  # it would be seen


def test_stripes_on_a_daily_course_are_those_of_two_runs():
    stripes = Stripes(width=4.0, offsets=(0.0, 20.0))
    course = day(10.0, 8.0).model_copy(update={"patterns": (stripes,)})
    both, few, many = (last(GRID, exchange(q)) for q in (course, day(10.0, 8.0), day(30.0, 8.0)))
    np.testing.assert_allclose(both.temperature[..., :8], few.temperature[..., :8], rtol=0, atol=1e-11)
    np.testing.assert_allclose(both.temperature[..., 8:], many.temperature[..., 8:], rtol=0, atol=1e-11)
    assert np.max(np.abs(few.temperature - last(GRID, exchange(10.0)).temperature)) > 0.3


def graded(folder, low, high, ends=(-6.0, 14.0)):
    """A coefficient that grows evenly along x, from a picture, and the grid above it."""
    Pictures.fromarray(np.array([[0, 65535]], dtype=np.uint16)).save(folder / "map.png")
    image = Image(file=folder / "map.png", values=(low, high), x=ends, y=(0.0, 1.0))
    grid = GridSpec(x=(0, 8), y=(0, 1), height=0.5, cells=(150, 1, 24), first_cell=0.003).build()
    return grid, Quantity(value=1.0, patterns=(image,))


@pytest.mark.parametrize("step", [0.5, 20.0, 500.0])
def test_levels_of_an_image_err_less_than_their_bound(tmp_path, step):
    grid, coefficient = graded(tmp_path, 0.2, 2.2)
    values = coefficient.at(grid, 0.0)[0]
    assert np.unique(values).size == 150 > LEVELS
    state = last(grid, exchange(coefficient), 20 * step, step, diffusivity=MOLECULES)
    ground = exchange(1.0)
    column = VerticalDiffusion.build(grid, MOLECULES, ground, Top())
    ends = column.conductance(np.array([values.min(), values.max()]))
    ratio = float(ends[1] / ends[0]) ** (1 / (LEVELS - 1))
    bound = (ratio - 1) ** 2 / 4 * (WARM - 300.0)

    def alone(value):
        single = GridSpec(x=(0, 1), y=(0, 1), height=0.5, cells=(1, 1, 24), first_cell=0.003).build()
        return last(single, exchange(value), 20 * step, step, diffusivity=MOLECULES).temperature[:, 0, 0]

    chosen = range(0, 150, 11)
    error = max(np.max(np.abs(state.temperature[:, 0, i] - alone(float(values[i])))) for i in chosen)
    assert 0 < error < bound
    # the nearest level instead of the mean of two would be off by up to half the distance of the levels
    rounded = alone(values[70] * (ratio + 1) / 2)
    assert np.max(np.abs(rounded - alone(float(values[70])))) > 2 * bound


def test_fewer_levels_miss_the_bound_of_more(tmp_path):
    grid, coefficient = graded(tmp_path, 0.2, 2.2)
    column = VerticalDiffusion.build(grid, MOLECULES, exchange(1.0), Top())
    errors = {}
    for count in (5, LEVELS):
        course = ExchangeCourse(grid, column, coefficient, count)
        conductances, lower, weight = course.matrices_at(0.0)
        met = np.array(conductances)
        np.testing.assert_allclose(
            (1 - weight) * met[lower] + weight * met[lower + 1], course.at(0.0), rtol=1e-13
        )
        column_number = int(np.argmax(weight * (1 - weight)))
        exact = column.step(500.0, float(course.at(0.0)[column_number]))
        two = [column.step(500.0, float(met[lower[column_number] + i])) for i in (0, 1)]
        blend = (1 - weight[column_number]) * two[0] + weight[column_number] * two[1]
        errors[count] = np.max(np.abs(blend - exact))
    # the error falls with the square of the distance of the levels: (63 / 4)² = 248, less the curvature
    assert 80 < errors[5] / errors[LEVELS] < 750


@pytest.mark.parametrize("in_time", [False, True])
def test_image_makes_no_new_extrema_and_runs_alike(tmp_path, in_time):
    grid, coefficient = graded(tmp_path, 0.0, 400.0, ends=(0.0, 8.0))  # a quarter of the ground is insulated
    if in_time:
        image = coefficient.patterns[0].model_copy(update={"values": None, "offsets": (0.0, 400.0)})
        coefficient = day(10.0, 10.0).model_copy(update={"patterns": (image,)})
    initial = 300 + 20 * np.random.default_rng(3).random(grid.shape)
    setting = {"wind": Wind(speed=0.05), "time": 40.0, "step": 4.0, "initial": initial}
    first, second = (last(grid, exchange(coefficient, 290.0), **setting) for _ in range(2))
    np.testing.assert_array_equal(first.temperature, second.temperature)
    for values in (first.temperature, first.surface_temperature):
        assert values.min() >= 290 - 1e-12
        assert values.max() <= 320 + 1e-12
    assert np.ptp(first.surface_temperature) > 5


def test_zero_coefficient_is_an_insulated_wall(tmp_path):
    closed = {"top": Top(kind="insulated"), "initial": 300 + GRID.z[:, None, None]}
    insulated = last(GRID, FluxGround(heat_flux=0.0), **closed)
    for coefficient in (0.0, Quantity(value=0.0, patterns=(Stripes(width=4.0, values=(0.0, 9.0)),))):
        state = last(GRID, exchange(coefficient), **closed)
        np.testing.assert_allclose(
            state.temperature[..., :8], insulated.temperature[..., :8], rtol=0, atol=1e-11
        )
        np.testing.assert_array_equal(state.surface_temperature[:, :8], state.temperature[0, :, :8])
    assert np.min(state.temperature[0, :, 8:] - insulated.temperature[0, :, 8:]) > 1


def test_coefficient_without_end_is_a_held_wall():
    held = last(GRID, HeldGround(temperature=WARM))
    state = last(GRID, exchange(1e12))
    np.testing.assert_allclose(state.temperature, held.temperature, atol=1e-6)
    assert np.max(np.abs(last(GRID, exchange(20.0)).temperature - held.temperature)) > 1


def test_means_of_levels_conserve_heat(tmp_path):
    # what the air loses is what the ground and the top take: columns of the matrix times the widths
    grid, coefficient = graded(tmp_path, 0.2, 2.2)
    column = VerticalDiffusion.build(grid, EDDIES, exchange(1.0), Top())
    conductances, lower, weight = ExchangeCourse(grid, column, coefficient).matrices_at(0.0)
    for number in (0, 40, 149):
        low, high = lower[number], lower[number] + 1
        matrix = sum(
            share * column.step(30.0, conductances[level])
            for share, level in ((1 - weight[number], low), (weight[number], high))
        )
        assert matrix.min() >= 0
        np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=0, atol=1e-14)
        weighted = column.widths[:, None] * matrix[:, : column.widths.size]
        np.testing.assert_allclose(weighted, weighted.T, rtol=0, atol=1e-15)


def test_levels_span_what_is_asked():
    np.testing.assert_allclose(conductance_levels(1.0, 16.0, 5), [1, 2, 4, 8, 16])
    levels = conductance_levels(0.0, 10.0)
    assert levels.size == LEVELS + 1
    assert (levels[0], levels[1], levels[-1]) == pytest.approx((0.0, 0.01, 10.0))
    ratio = levels[2] / levels[1]
    assert (ratio - 1) ** 2 / 4 < 0.004  # as documented
    assert ratio == pytest.approx(1000 ** (1 / 63))


def test_memory_of_matrices_is_bounded():
    # a coefficient that changes at every step needs other matrices at every step
    course = Quantity(schedule=Schedule(times=(0, 1000), values=(1, 50)))
    column = VerticalDiffusion.build(GRID, EDDIES, exchange(course), Top())
    steps = ColumnSteps(GRID, column, exchange(course), workers=1)
    air = np.zeros((GRID.shape[0] + 3, 128))
    for time in range(1500):
        steps.work(1.0, float(time), air, air)
    kept = steps.matrices.cache_info().currsize * 8 * 20 * 25
    assert kept <= 2**22
    assert steps.matrices.cache_info().misses == 1001  # constant after the schedule's end
    assert math.prod(GRID.shape) * 8 < 2**22
