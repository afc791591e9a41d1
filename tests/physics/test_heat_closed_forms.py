"""Heat conduction against closed forms (Carslaw and Jaeger, Conduction of Heat in Solids, 2nd ed. 1959)."""

import math

import numpy as np
import pytest
from scipy.special import erfc, erfcx

from nigemizu.heat import (
    Diffusivity,
    ExchangeGround,
    FluxGround,
    GridSpec,
    HeldGround,
    Sides,
    Top,
    Wind,
    evolve,
)

ALPHA = 2.2e-5  # m2 s-1, of the reference cases
DENSITY, SPECIFIC_HEAT = 1.177, 1006.0


def column(height, cells, first_cell=None):
    return GridSpec(x=(0, 1), y=(0, 1), height=height, cells=(1, 1, cells), first_cell=first_cell).build()


def run(grid, initial, times, **setting):
    return list(evolve(grid, np.broadcast_to(initial, grid.shape), times=times, **setting))


def at(grid, state, height):
    """Temperature at a height, by a parabola through the nearest three centres."""
    profile = state.temperature[:, 0, 0]
    near = int(np.clip(np.argmin(np.abs(grid.z - height)), 1, grid.z.size - 2))
    three = slice(near - 1, near + 2)
    return float(np.polyval(np.polyfit(grid.z[three] - height, profile[three], 2), 0.0))


# Wall step 300 -> 330 K over a half-space: T = 300 + 30 erfc(z / sqrt(4 alpha t)).
# Numbers computed independently by numerical inverse Laplace transform (Talbot), agreeing to 1e-10.
HALF_SPACE = [
    (0.01, 10.0, 319.00660426130503),
    (0.02, 60.0, 320.9127483001789),
    (0.05, 60.0, 309.9147550847779),
]


@pytest.mark.parametrize(("height", "time", "expected"), HALF_SPACE)
def test_heated_half_space(height, time, expected):
    # A second-order scheme errs by about dz² T''/12·O(1); cells of 1 mm in a layer of 15 mm: below 5 mK.
    grid = column(0.4, 160, first_cell=0.0008)
    (state,) = run(grid, 300.0, [time], ground=HeldGround(temperature=330), time_step=5.0)
    assert abs(at(grid, state, height) - expected) < 5e-3
    np.testing.assert_array_equal(state.surface_temperature, 330.0)


def test_half_space_notices_a_wrong_diffusivity():
    height, time, expected = HALF_SPACE[1]
    grid = column(0.4, 160, first_cell=0.0008)
    wrong = Diffusivity(molecular=1.05 * ALPHA)
    (state,) = run(grid, 300.0, [time], ground=HeldGround(temperature=330), diffusivity=wrong)
    assert abs(at(grid, state, height) - expected) > 0.1


# Slab of 0.1 m, faces at 330 and 300 K, 300 K at first: Fourier series and image sum agree to 1e-15.
@pytest.mark.parametrize(
    ("height", "time", "expected"), [(0.025, 30.0, 314.74160609691376), (0.05, 100.0, 312.82222938774044)]
)
def test_slab_between_two_held_faces(height, time, expected):
    grid = column(0.1, 100)
    top = Top(kind="held", temperature=300)
    (state,) = run(grid, 300.0, [time], ground=HeldGround(temperature=330), top=top)
    # error at most dz² max|T''|/12·(a few): 1e-6·30/(2.2e-5·30)/12 = 4 mK
    assert abs(at(grid, state, height) - expected) < 4e-3


def test_steady_slab_is_a_straight_line():
    grid = column(0.1, 20, first_cell=0.001)
    top = Top(kind="held", temperature=300)
    (state,) = run(grid, 315.0, [1e5], ground=HeldGround(temperature=330), top=top)
    # conduction between centres is exact for a straight line, on the stretched mesh too
    np.testing.assert_allclose(state.temperature[:, 0, 0], 330 - 300 * grid.z, atol=1e-9)


def test_steady_eddy_profile_is_logarithmic():
    # with constant flux T' = -F/K(z): K = alpha + kappa u* z gives a logarithm, whatever the cells
    grid = column(2.0, 24, first_cell=0.002)
    eddy = Diffusivity(kind="eddy", friction_velocity=0.2, cap_height=5.0)
    top = Top(kind="held", temperature=300)
    (state,) = run(grid, 310.0, [1e6], ground=HeldGround(temperature=330), top=top, diffusivity=eddy)
    slope = 0.4 * 0.2
    shape = np.log1p(slope * grid.z / ALPHA) / math.log1p(slope * 2.0 / ALPHA)
    np.testing.assert_allclose(state.temperature[:, 0, 0], 330 - 30 * shape, atol=1e-7)


def test_flux_boundary():
    # T - T0 = (2 q sqrt(alpha t) / k) ierfc(z / sqrt(4 alpha t)), §2.9 (7); k = rho cp alpha
    flux, time = 20.0, 40.0
    conductivity = DENSITY * SPECIFIC_HEAT * ALPHA
    grid = column(0.4, 160, first_cell=0.0008)
    (state,) = run(grid, 300.0, [time], ground=FluxGround(heat_flux=flux), top=Top(kind="insulated"))
    argument = grid.z / math.sqrt(4 * ALPHA * time)
    ierfc = np.exp(-(argument**2)) / math.sqrt(math.pi) - argument * erfc(argument)
    scale = 2 * flux * math.sqrt(ALPHA * time) / conductivity
    np.testing.assert_allclose(state.temperature[:, 0, 0], 300 + scale * ierfc, atol=1e-4 * scale)
    skin = 300 + scale / math.sqrt(math.pi)
    # the half cell of 0.4 mm is bridged by the gradient at the wall: second order in it
    assert abs(float(state.surface_temperature[0, 0]) - skin) < 1e-4 * scale


def test_exchange_boundary():
    # T - T0 = (Te - T0) [erfc(a) - exp(h z + h² alpha t) erfc(a + h sqrt(alpha t))], §2.7 (1); h = H/k
    coefficient, time = 2.0, 40.0
    grid = column(0.4, 160, first_cell=0.0008)
    ground = ExchangeGround(coefficient=coefficient, temperature=330)
    (state,) = run(grid, 300.0, [time], ground=ground)
    h = coefficient / (DENSITY * SPECIFIC_HEAT * ALPHA)
    a = grid.z / math.sqrt(4 * ALPHA * time)
    b = a + h * math.sqrt(ALPHA * time)
    exact = 300 + 30 * (erfc(a) - np.exp(h * grid.z + h * h * ALPHA * time - b * b) * erfcx(b))
    np.testing.assert_allclose(state.temperature[:, 0, 0], exact, atol=3e-3)
    skin = 300 + 30 * (1 - erfcx(h * math.sqrt(ALPHA * time)))
    assert abs(float(state.surface_temperature[0, 0]) - skin) < 3e-3
    assert np.max(np.abs(exact - (300 + 30 * erfc(a)))) > 0.5  # a held wall would be seen


def fourier_mode(cells):
    """The mode cos(2πx/0.1) cos(2πy/0.2) cos(πz/0.1) between insulated ground and top."""
    grid = GridSpec(x=(0, 0.1), y=(0, 0.2), height=0.1, cells=(cells, cells, cells)).build()
    shape = (
        np.cos(math.pi * grid.z / 0.1)[:, None, None]
        * np.cos(2 * math.pi * grid.y / 0.2)[:, None]
        * np.cos(2 * math.pi * grid.x / 0.1)
    )
    return grid, shape


def test_fourier_mode_decays():
    # exp(-alpha k² t) at t = 5 s: 0.5213186090407093 (closed form). In space the cosine decays by the
    # second-order eigenvalue: relative error of the exponent (k dx)²/12, here 3.2e-3·0.651·0.8
    grid, shape = fourier_mode(32)
    insulated = {"ground": FluxGround(heat_flux=0.0), "top": Top(kind="insulated")}
    (state,) = run(grid, 300 + 10 * shape, [5.0], **insulated)
    factor = float(np.sum((state.temperature - 300) * shape) / np.sum(10 * shape * shape))
    exact = 0.5213186090407093
    k2 = [(2 * math.pi / 0.1) ** 2, (2 * math.pi / 0.2) ** 2, (math.pi / 0.1) ** 2]
    steps = [0.1 / 32, 0.2 / 32, 0.1 / 32]
    discrete = math.exp(
        -ALPHA
        * 5
        * sum(4 * math.sin(math.sqrt(k) * d / 2) ** 2 / d**2 for k, d in zip(k2, steps, strict=True))
    )
    assert 0 < factor - exact < 1.5e-3
    assert abs(factor - discrete) < 1e-10  # nothing but the error in space is left
    assert abs(factor - exact**1.01) > 1e-5


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_semi_discrete_decay_to_every_digit(axis):
    # 16 cells per wavelength of 0.1 m, alpha dt/dx² = 0.25, 11 steps: exact in time is 0.657926161059845;
    # Crank-Nicolson would give 0.6578929038085369, an explicit Euler step 0.6525693404892536 (von Neumann)
    step, wave = 0.44389204545454547, 2 * math.pi / 0.1
    cells = {name: 16 if name == axis else 1 for name in "xyz"}
    extent = {name: (0, 0.1 if name == axis else 1.0) for name in "xyz"}
    grid = GridSpec(
        x=extent["x"], y=extent["y"], height=extent["z"][1], cells=(cells["x"], cells["y"], cells["z"])
    ).build()
    # in height the insulated walls mirror the wave: cos(k z) has no gradient there
    shape = np.cos(wave * {"x": grid.x, "y": grid.y, "z": grid.z}[axis])
    shape = shape.reshape(grid.shape)
    insulated = {"ground": FluxGround(heat_flux=0.0), "top": Top(kind="insulated")}
    (state,) = run(grid, 300 + 10 * shape, [11 * step], time_step=step, **insulated)
    factor = float(np.sum((state.temperature - 300) * shape) / np.sum(10 * shape * shape))
    assert abs(factor - 0.657926161059845) < 2e-13


def test_gaussian_spreads_in_three_dimensions():
    # 10 K, s0 = 0.05 m, 20 s: centre 6.361140127161441 K, at r = 0.1 m 1.4490637898557972 K (heat kernel)
    cells = 65  # a cell centre in the middle
    grid = GridSpec(x=(-0.4, 0.4), y=(-0.4, 0.4), height=0.8, cells=(cells, cells, cells)).build()
    square = grid.x**2 + grid.y[:, None] ** 2 + (grid.z[:, None, None] - 0.4) ** 2
    initial = 300 + 10 * np.exp(-square / (2 * 0.05**2))
    insulated = {"ground": FluxGround(heat_flux=0.0), "top": Top(kind="insulated")}
    (state,) = run(grid, initial, [20.0], **insulated)
    # each axis delays the spreading by (dx/s)²/12·…: 1.5e-4/3.4e-3/12·3 of the decay, below 1 percent
    middle = cells // 2
    line = state.temperature[middle, middle] - 300
    assert 0 < line[middle] - 6.361140127161441 < 0.03
    at_tenth = float(np.interp(0.1, grid.x, np.log(line)))
    assert abs(math.exp(at_tenth) - 1.4490637898557972) < 0.03


@pytest.mark.parametrize("angle", [0.0, 90.0, 210.0])
def test_wind_carries_a_blob_where_it_should(angle):
    grid = GridSpec(x=(0, 8), y=(0, 8), height=1.0, cells=(64, 64, 2)).build()
    initial = 300 + 5 * np.exp(-((grid.x - 4) ** 2 + (grid.y[:, None] - 4) ** 2) / (2 * 0.5**2))
    still = Diffusivity(molecular=1e-12)
    (state,) = run(
        grid, initial, [1.0], ground=FluxGround(heat_flux=0.0), top=Top(kind="insulated"),
        diffusivity=still, wind=Wind(speed=1.3, direction=angle), time_step=0.05,
    )  # fmt: skip
    excess = state.temperature[0] - 300
    centre_x, centre_y = (
        np.sum(excess * grid.x) / excess.sum(),
        np.sum(excess * grid.y[:, None]) / excess.sum(),
    )
    assert abs(centre_x - (4 + 1.3 * math.cos(math.radians(angle)))) < 1e-3
    assert abs(centre_y - (4 + 1.3 * math.sin(math.radians(angle)))) < 1e-3
    # four cells per standard deviation keep the peak but for what the limiter clips; first-order upwind
    # differences would spread it by u dx (1 - c) / 2 = 0.039 m2/s and leave 5 (1 + 2·0.039/0.25)^-1/2 = 4.37
    assert 4.75 < excess.max() < 5.0


def test_wind_at_whole_cells_is_an_exact_copy():
    grid = GridSpec(x=(0, 8), y=(0, 4), height=1.0, cells=(16, 8, 1)).build()
    initial = 300 + np.random.default_rng(5).random(grid.shape)
    (state,) = run(
        grid, initial, [0.5], ground=FluxGround(heat_flux=0.0), top=Top(kind="insulated"),
        diffusivity=Diffusivity(horizontal=0.0), wind=Wind(speed=6.0), time_step=0.5,
    )  # fmt: skip
    # half a step carries by 3 cells of 0.5 m, twice
    np.testing.assert_allclose(state.temperature, np.roll(initial, 6, axis=2), rtol=1e-15)


def test_sheared_wind_moves_each_level_at_its_own_speed():
    grid = GridSpec(x=(0, 10), y=(0, 1), height=4.0, cells=(50, 1, 4)).build()
    initial = 300 + np.exp(-((grid.x - 5) ** 2) / 2)
    wind = Wind(shear="log", speed=2.0, reference_height=2.0, roughness=0.01)
    (state,) = run(
        grid, initial, [1.0], ground=FluxGround(heat_flux=0.0), top=Top(kind="insulated"),
        diffusivity=Diffusivity(molecular=1e-12), wind=wind,
    )  # fmt: skip
    phase = np.angle(np.sum((state.temperature[:, 0] - 300) * np.exp(2j * math.pi * grid.x / 10), axis=1))
    moved = (
        (phase - np.angle(np.sum((initial - 300) * np.exp(2j * math.pi * grid.x / 10)))) * 10 / (2 * math.pi)
    )
    expected = 2.0 * np.log(grid.z / 0.01) / math.log(2.0 / 0.01)
    np.testing.assert_allclose(moved % 10, expected, atol=2e-3)
    assert np.ptp(expected) > 0.5


def test_wind_from_an_insulated_side_brings_the_outermost_temperature():
    grid = GridSpec(x=(0, 10), y=(0, 1), height=1.0, cells=(20, 1, 1)).build()
    initial = np.broadcast_to(np.where(grid.x < 5, 310.0, 300.0), grid.shape)
    (state,) = run(
        grid, initial, [20.0], ground=FluxGround(heat_flux=0.0), top=Top(kind="insulated"),
        diffusivity=Diffusivity(horizontal=0.0), wind=Wind(speed=1.0), sides=Sides(x="insulated"),
    )  # fmt: skip
    np.testing.assert_allclose(state.temperature, 310.0, rtol=1e-14)
