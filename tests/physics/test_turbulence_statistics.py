"""The statistics of the generated air against the theory of von Kármán, Kolmogorov and Tatarskii.

Instants far apart in time are independent draws (no eddy lives from one to the next), so that the standard
error of a mean over instants is their scatter over sqrt(N). A value passes when the theory lies within
four of them plus a stated tolerance for what is approximated (one per cent: the interpolated vertical
factors, 0.4 %, and the mean of the level that a periodic box lacks). `consistent` refuses samples too few to
notice 20 %.
"""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma

from nigemizu.air import refractivity
from nigemizu.errors import NigemizuWarning
from nigemizu.heat import GridSpec, Wind
from nigemizu.heat.turbulence import (
    StructureTable,
    Turbulence,
    TurbulentField,
    angle_of_arrival_variance,
    cn2_from_ct2,
    structure_function,
)
from nigemizu.heat.turbulence.field import MEMORY, share

INERTIAL = float(gamma(8 / 3)) * math.sin(math.pi / 3) / (4 * math.pi**2)
VARIANCE = 0.15371695001098  # σ² = VARIANCE · C_T² L0^(2/3): 2π A Γ(3/2) Γ(1/3) / Γ(11/6) (2π)^(-2/3)
TINY = 5e-4  # m, an inner scale far below the cells


def consistent(samples, theory, tolerance=0.01):
    """Whether the mean of independent samples agrees with the theory."""
    samples = np.asarray(samples)
    error = 4 * samples.std(ddof=1) / math.sqrt(samples.size) / theory + tolerance
    assert error < 0.18, f"{samples.size} samples cannot tell 20 % apart (± {error:.2f})"
    return abs(samples.mean() / theory - 1) < error


def renewed(grid, **settings):
    """Air that is another one a second later."""
    settings = {
        "ct2": 0.3,
        "exponent": 0.0,
        "inner_scale": TINY,
        "eddy_lifetime": 0.01,
        "seed": 11,
    } | settings
    return TurbulentField(grid, Turbulence(**settings))


def instants(field, count):
    return [field.at(10.0 * number) for number in range(count)]


def horizontal(kx, ky, k0):
    """Spectrum integrated over the vertical wave number, C_T² = 1 (closed form, no inner scale)."""
    constant = INERTIAL * math.sqrt(math.pi) * gamma(4 / 3) / gamma(11 / 6)
    return constant * (kx**2 + ky**2 + k0**2) ** (-4 / 3)


def legendre(low, high, panels, points=8):
    nodes, weights = np.polynomial.legendre.leggauss(points)
    ends = np.linspace(low, high, panels + 1)
    half, middle = np.diff(ends) / 2, (ends[1:] + ends[:-1]) / 2
    return (middle[:, None] + half[:, None] * nodes).ravel(), (half[:, None] * weights).ravel()


# --- in space -------------------------------------------------------------------------------------------

STRETCHED = GridSpec(x=(0, 8), y=(0, 4), height=2.0, cells=(128, 128, 24), first_cell=0.02).build()
X_STEP, Y_STEP = 8 / 128, 4 / 128


@pytest.fixture(scope="module")
def folded():
    return instants(renewed(STRETCHED, outer_scale=1.0, unresolved="folded"), 16)


@pytest.fixture(scope="module")
def left_out():
    return instants(renewed(STRETCHED, outer_scale=1.0), 16)


def difference(volume, x=0, y=0, low=None, high=None):
    """Mean square over the difference between two cells x, y apart, or between two levels."""
    if low is not None:
        return np.mean((volume[high] - volume[low]) ** 2)
    return np.mean((np.roll(volume, (x, y), (2, 1)) - volume) ** 2)


ACROSS = [(1, 0), (2, 0), (4, 0), (8, 0), (16, 0), (0, 1), (0, 2), (0, 4), (0, 16), (2, 4), (4, 8)]
UP = [(0, 2), (0, 4), (3, 8), (8, 10), (10, 15), (0, 14), (12, 22)]


@pytest.mark.parametrize(("x", "y"), ACROSS)
def test_structure_function_between_cells(folded, x, y):
    r = math.hypot(x * X_STEP, y * Y_STEP)
    theory = float(structure_function(r, 0.3, outer_scale=1.0, inner_scale=TINY))
    samples = [difference(volume, x, y) for volume in folded]
    assert consistent(samples, theory, 0.015)
    assert not consistent(samples, 1.2 * theory, 0.015)
    assert not consistent(samples, theory / 1.2, 0.015)


@pytest.mark.parametrize(("low", "high"), UP)
def test_structure_function_between_levels(folded, low, high):
    r = STRETCHED.z[high] - STRETCHED.z[low]
    theory = float(structure_function(r, 0.3, outer_scale=1.0, inner_scale=TINY))
    samples = [difference(volume, low=low, high=high) for volume in folded]
    assert consistent(samples, theory, 0.015)
    assert not consistent(samples, 1.2 * theory, 0.015)


def test_structure_function_has_the_power_two_thirds(folded):
    # a wrong power, even if right at one distance, fails at another
    near, far = ([difference(volume, y=y) for volume in folded] for y in (1, 4))
    theory = float(structure_function(Y_STEP, 0.3, outer_scale=1.0, inner_scale=TINY))
    assert consistent(near, theory)
    grown = float(structure_function(4 * Y_STEP, 1.0, outer_scale=1.0)) / float(
        structure_function(Y_STEP, outer_scale=1.0)
    )
    assert consistent(far, theory * grown, 0.015)
    for power in (1 / 3, 1.0):
        assert not consistent(far, theory * grown * 4 ** (power - 2 / 3), 0.015)


@pytest.mark.parametrize(("x", "y"), [(2, 0), (4, 0), (16, 0), (0, 2), (0, 4), (0, 16)])
def test_what_is_left_out_is_what_lies_beyond_the_nyquist_wave_numbers(left_out, x, y):
    # 127 of 128 wave numbers along x and y, each with its interval
    kx, weights_x = legendre(0, math.pi / X_STEP * 127 / 128, 24)
    ky, weights_y = legendre(0, math.pi / Y_STEP * 127 / 128, 24)
    bracket = 1 - np.cos(kx * x * X_STEP) * np.cos(ky[:, None] * y * Y_STEP)
    spectrum = horizontal(kx, ky[:, None], 2 * math.pi)
    theory = 0.3 * 8 * np.sum(spectrum * bracket * weights_x * weights_y[:, None])
    samples = [difference(volume, x, y) for volume in left_out]
    assert consistent(samples, theory, 0.015)
    assert not consistent(samples, 1.2 * theory, 0.015)
    whole = float(structure_function(math.hypot(x * X_STEP, y * Y_STEP), 0.3, outer_scale=1.0))
    assert 0.55 < theory / whole < 0.95


def test_long_cells_hold_the_same_line_integrals():
    # the variance of the mean along x, over a box of one length, must not depend on the cells along x
    def means(cells):
        grid = GridSpec(x=(0, 32), y=(0, 8), height=0.5, cells=(cells, 64, 3)).build()
        return [np.mean(volume.mean(axis=2) ** 2) for volume in instants(renewed(grid, outer_scale=2.0), 200)]

    # modes kx = 0 hold the interval of ± half a step about it
    kx, weights_x = legendre(-math.pi / 32, math.pi / 32, 2)
    ky, weights_y = legendre(math.pi / 8, math.pi / (8 / 64) * 63 / 64, 40)
    theory = 0.3 * 2 * np.sum(horizontal(kx, ky[:, None], math.pi) * weights_x * weights_y[:, None])
    for cells in (16, 64):
        samples = means(cells)
        assert consistent(samples, theory)
        assert not consistent(samples, 1.2 * theory)


def test_one_dimensional_spectrum_falls_with_five_thirds():
    grid = GridSpec(x=(0, 25.6), y=(0, 6.4), height=0.2, cells=(1024, 256, 1)).build()
    volumes = instants(renewed(grid, outer_scale=4.0), 36)
    k = 2 * math.pi / 25.6 * np.arange(513)
    inertial = (k > 10) & (k < 30)  # k0 = 1.6, Nyquist wave number 126
    slopes = []
    for volume in volumes:
        power = np.mean(np.abs(np.fft.rfft(volume, axis=2)) ** 2, axis=(0, 1))
        slopes.append(np.polyfit(np.log(k[inertial]), np.log(power[inertial]), 1)[0])
    mean, error = np.mean(slopes), 4 * np.std(slopes, ddof=1) / math.sqrt(len(slopes))
    assert error < 0.04
    # the eddies left out along y steepen it by 0.04, the outer scale flattens it by 0.02
    assert abs(mean + 5 / 3 + 0.02) < error + 0.02
    for wrong in (-3 / 2, -2.0, -11 / 6):
        assert abs(mean - wrong) > error + 0.02


def test_a_narrow_box_loses_only_the_mean_of_its_levels():
    grid = GridSpec(x=(0, 128), y=(0, 2), height=0.2, cells=(512, 16, 1)).build()
    with pytest.warns(NigemizuWarning, match="box is 2 m long along y"):
        field = renewed(grid, outer_scale=16.0, unresolved="folded")
    kx, weights_x = legendre(0, math.pi / 128, 4)
    ky, weights_y = legendre(0, math.pi / 2, 40)
    mean = 4 * np.sum(horizontal(kx, ky[:, None], 2 * math.pi / 16) * weights_x * weights_y[:, None])
    whole = VARIANCE * 16 ** (2 / 3)
    assert 0.02 < mean / whole < 0.2
    assert field.variance[0] / 0.3 == pytest.approx(whole - mean, rel=5e-3)


# --- over the height ------------------------------------------------------------------------------------

TALL = GridSpec(x=(0, 16), y=(0, 16), height=4.0, cells=(128, 128, 10), first_cell=0.1).build()


@pytest.mark.parametrize(
    "settings",
    [
        {"exponent": -4 / 3, "outer_scale": 2.0},
        {"ct2": StructureTable(heights=(0.2, 1.0, 3.0), values=(1.0, 0.1, 0.05)), "outer_scale": 1.5},
        {"exponent": -4 / 3, "outer_scale_per_height": 9.0, "outer_scale": 3.0},
        {"ct2": None, "cn2": 1e-13, "outer_scale": 2.0, "exponent": -2 / 3},
    ],
    ids=["convection", "table", "growing eddies", "index"],
)
def test_variance_follows_the_structure_parameter(settings):
    field = renewed(TALL, unresolved="folded", **settings)
    volumes = instants(field, 12)
    air = field.settings
    # what is below the inner scale is missing: D(r) → r^(2/3) − 0.515 l0^(2/3), and half of that is variance
    scales = VARIANCE * air.outer_scale_at(TALL.z) ** (2 / 3) - 0.2575 * TINY ** (2 / 3)
    theory = air.structure_parameter(TALL.z) * scales
    # the mean that a box of sixteen metres lacks is 0.5 % for eddies of three metres
    for level in (0, 3, 6, 9):
        samples = [np.mean(volume[level] ** 2) for volume in volumes]
        assert consistent(samples, theory[level], 0.02)
        assert not consistent(samples, 1.2 * theory[level], 0.02)
        assert field.variance[level] == pytest.approx(theory[level], rel=0.015)


def test_free_convection_falls_with_four_thirds():
    volumes = instants(renewed(TALL, exponent=-4 / 3, outer_scale=2.0), 12)
    slopes = [np.polyfit(np.log(TALL.z), np.log(np.mean(v**2, axis=(1, 2))), 1)[0] for v in volumes]
    mean, error = np.mean(slopes), 4 * np.std(slopes, ddof=1) / math.sqrt(len(slopes))
    assert error < 0.15
    assert abs(mean + 4 / 3) < error
    assert abs(mean + 2 / 3) > error


def test_only_small_eddies_are_added_below_a_computed_flow():
    grid = GridSpec(x=(0, 8), y=(0, 8), height=0.5, cells=(128, 128, 2)).build()
    settings = {"outer_scale": 2.0, "unresolved": "folded"}
    whole, small = (instants(renewed(grid, **settings, largest=largest), 8) for largest in (None, 0.5))
    theory = float(structure_function(4.0, 0.3, outer_scale=2.0, inner_scale=TINY, largest=0.5)) / 2
    assert consistent([np.mean(v**2) for v in small], theory)
    assert not consistent([np.mean(v**2) for v in whole], theory)
    # at two cells, 0.125 m, three quarters of the structure function is there
    near = float(structure_function(0.125, 0.3, outer_scale=2.0, inner_scale=TINY, largest=0.5))
    assert consistent([difference(v, 2) for v in small], near)


# --- in time --------------------------------------------------------------------------------------------

BOX = GridSpec(x=(0, 4), y=(0, 2), height=2.0, cells=(64, 33, 8)).build()


def test_frozen_turbulence_is_shifted_by_the_wind():
    wind = Wind(speed=1.3, direction=30.0, shear="log", reference_height=2.0)
    field = TurbulentField(BOX, Turbulence(ct2=0.1, outer_scale=1.0, eddy_lifetime="frozen"), wind)
    start, time = field.at(0.0), 0.777
    u, v = wind.velocity(BOX.z)
    kx = 2 * math.pi / 4 * np.fft.fftfreq(64, 1 / 64)
    ky = 2 * math.pi / 2 * np.fft.fftfreq(33, 1 / 33)
    turn = np.exp(-1j * time * (kx * u[:, None, None] + ky[:, None] * v[:, None, None]))
    moved = np.fft.ifft2(np.fft.fft2(start) * turn).real
    np.testing.assert_allclose(field.at(time), moved, atol=1e-12)
    assert np.max(np.abs(field.at(time) - np.fft.ifft2(np.fft.fft2(start) / turn).real)) > 0.1
    # whole cells without a transform: two cells along x, forward
    field = TurbulentField(BOX, Turbulence(ct2=0.1, outer_scale=1.0, eddy_lifetime="frozen"), Wind(speed=2.0))
    np.testing.assert_allclose(field.at(2 * 0.0625 / 2), np.roll(field.at(0.0), 2, axis=2), atol=1e-12)
    np.testing.assert_allclose(field.at(2.0), field.at(0.0), atol=1e-12)  # frozen air comes back


def test_living_turbulence_does_not_come_back_with_the_box():
    # a lifetime that would let large eddies outlive the two seconds in which the wind blows through
    field = TurbulentField(BOX, Turbulence(ct2=0.1, outer_scale=1.0, eddy_lifetime=30.0), Wind(speed=2.0))
    period = 2.0
    starts = [field.at(17.0 * number) for number in range(24)]
    for passes in (1, 2, 5):
        later = [field.at(17.0 * number + passes * period) for number in range(24)]
        alike = [np.mean(a * b) / np.mean(a * a) for a, b in zip(starts, later, strict=True)]
        error = 4 * np.std(alike, ddof=1) / math.sqrt(24)
        assert error < 0.2
        assert abs(np.mean(alike)) < error
    # but it does move with the wind over shorter times
    soon = [np.roll(field.at(17.0 * number + 0.125), -4, axis=2) for number in range(24)]
    assert np.mean([np.mean(a * b) / np.mean(a * a) for a, b in zip(starts, soon, strict=True)]) > 0.8


def test_the_two_epochs_always_add_up():
    at = np.linspace(0, 1, 101)
    np.testing.assert_allclose([share(s) ** 2 + share(s - 1) ** 2 for s in at], 1.0, atol=1e-15)
    assert pytest.approx(0.5 * quad(share, -1, 1)[0] ** 2, rel=1e-10) == MEMORY


@pytest.mark.parametrize(("low", "high"), [(5.0, 8.0), (14.0, 20.0)])
def test_eddies_live_as_long_as_their_size_says(low, high):
    grid = GridSpec(x=(0, 8), y=(0, 4), height=2.0, cells=(64, 33, 4)).build()
    field = TurbulentField(grid, Turbulence(ct2=0.1, outer_scale=1.0, eddy_lifetime=2.0))
    kx = 2 * math.pi / 8 * np.fft.fftfreq(64, 1 / 64)
    ky = 2 * math.pi / 4 * np.fft.fftfreq(33, 1 / 33)
    k = np.hypot(kx, ky[:, None])
    chosen = (k > low) & (k < high)
    lifetime = float(np.mean([field.lifetime(number) for number in k[chosen]]))
    assert lifetime == pytest.approx(2.0 * (2 * math.pi / np.mean(k[chosen])) ** (2 / 3), rel=0.05)

    def waves(time):
        return np.fft.fft2(field.at(time))[:, chosen]

    # integral of the correlation over the lag, by the trapezoidal rule; zero beyond two epochs
    lags = np.linspace(0, 2.2 * lifetime / MEMORY, 12)
    integrals = []
    for number in range(48):
        start = 7.77 * lifetime * number
        first = waves(start)
        along = [np.mean((first.conj() * waves(start + lag)).real) for lag in lags]
        integrals.append(np.trapezoid(along, lags) / along[0])
    assert consistent(integrals, lifetime, 0.06)  # bands of a quarter of an octave: 6 %
    assert not consistent(integrals, 1.35 * lifetime, 0.06)


# --- light ----------------------------------------------------------------------------------------------

SIDE, PATH, LEVELS, FAR = 1 / 32, 16.0, 12, 4.0
WARM = 300.0
INDEX = float(refractivity(WARM, 101325.0)) / WARM  # −dn/dT, K-1


@pytest.fixture(scope="module")
def paths():
    """Optical path lengths through the air along x, (nz, ny), for many instants."""
    box = GridSpec(x=(0, PATH), y=(0, 16), height=LEVELS * SIDE, cells=(8, 512, LEVELS)).build()
    return [INDEX * v.sum(axis=2) * PATH / 8 for v in instants(renewed(box, outer_scale=FAR), 220)]


@pytest.mark.parametrize("axis", ["y", "z"])
def test_angle_of_arrival_of_a_plane_wave(paths, axis):
    """Straight rays through the air: mean transverse gradient of the index over a round aperture.

    The theory is integrated with what the rays see: wave numbers that the cells hold, differences over two
    cells for the gradient, a disc made of nodes. It differs from the closed form by a few per cent.
    """
    radius = 4 * SIDE
    cn2 = float(cn2_from_ct2(0.3, WARM, 101325.0))
    nodes = [(j, k) for j in range(-4, 5) for k in range(-4, 5) if j * j + k * k <= 16]
    y, z = np.array(nodes).T * SIDE

    ky, weights_y = legendre(0, math.pi / SIDE * 511 / 512, 60)
    kz, weights_z = legendre(0, 8 * math.pi / SIDE, 480)
    cosines = np.cos(np.multiply.outer(ky, y)), np.cos(np.multiply.outer(kz, z))
    filtered = cosines[0] @ cosines[1].T / len(nodes)
    spectrum = INERTIAL * (ky[:, None] ** 2 + kz**2 + (2 * math.pi / FAR) ** 2) ** (-11 / 6)
    gradient = np.sin((ky[:, None] if axis == "y" else kz) * SIDE) / SIDE
    whole = np.sum(spectrum * (gradient * filtered) ** 2 * weights_y[:, None] * weights_z)
    theory = 2 * math.pi * cn2 * PATH * 4 * whole
    closed = angle_of_arrival_variance(cn2, PATH, 2 * radius, outer_scale=FAR, inner_scale=TINY)
    assert theory == pytest.approx(closed, rel=0.1)

    samples = []
    for path in paths:
        angle = np.zeros(path.shape[1])
        for j, k in nodes:
            level = LEVELS // 2 + k
            if axis == "y":
                angle += np.roll(path[level], -j - 1) - np.roll(path[level], -j + 1)
            else:
                angle += np.roll(path[level + 1] - path[level - 1], -j)
        samples.append(np.mean((angle / (2 * SIDE * len(nodes))) ** 2))
    assert consistent(samples, theory, 0.02)
    assert not consistent(samples, 1.2 * theory, 0.02)
    assert not consistent(samples, theory / 1.2, 0.02)
