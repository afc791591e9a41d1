"""Heated air against theory and benchmarks: onset, rolls, the heated cavity, laws of the ground."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eig

from nigemizu.heat import Convection, ExchangeGround, FluxGround, GridSpec, HeldGround, Quantity, Sides, Top
from nigemizu.heat.flow.ground import GroundLayer
from nigemizu.heat.flow.moving import MovingAir

PRANDTL = 0.71
WARM, COLD, MEAN = 300.5, 299.5, 300.0
DIFFUSIVITY = 1e-3  # m2/s; times are in units of 1 m² over it
CRITICAL = (
    1707.7617771047182  # S. Chandrasekhar (1961), Hydrodynamic and Hydromagnetic Stability; rigid-rigid
)
CRITICAL_NUMBER = 3.116323554821122


def laboratory(rayleigh, **changes):
    """Air one metre high, of which the buoyancy makes the Rayleigh number; walls everywhere."""
    viscosity = PRANDTL * DIFFUSIVITY
    return Convection(
        viscosity=viscosity,
        closure="none",
        top="no-slip",
        sides="no-slip",
        gravity=rayleigh * MEAN * viscosity * DIFFUSIVITY,
        lapse_rate=0.0,
        noise=0.0,
        **changes,
    )


def layer(rayleigh, cells, length, **changes):
    """A layer heated from below with a small roll in it."""
    grid = GridSpec(x=(0, length), y=(0, 1), height=1.0, cells=(cells[0], 1, cells[1])).build()
    air = MovingAir(
        grid, laboratory(rayleigh, **changes), HeldGround(temperature=Quantity(value=WARM)), Sides(),
        Top(temperature=COLD), DIFFUSIVITY,
    )  # fmt: skip
    conduction = (WARM - grid.z)[:, None, None] * np.ones(grid.shape)
    roll = np.sin(np.pi * grid.z)[:, None, None] * np.cos(2 * np.pi * grid.x / length)
    return air, conduction, roll


def growth_by_theory(rayleigh, number, points=24):
    """Largest growth rate of a disturbance exp(σt + iax), in units of κ/h²: Chebyshev collocation.

    (D² − a²)² w / Pr σ-terms: σ (D² − a²) w = Pr (D² − a²)² w − Ra Pr a² θ, σ θ = (D² − a²) θ + w.
    """
    k = np.arange(points + 1)
    x = np.cos(np.pi * k / points)
    c = np.where((k == 0) | (k == points), 2.0, 1.0) * (-1.0) ** k
    difference = x[:, None] - x[None, :] + np.eye(points + 1)
    d = np.outer(c, 1 / c) / difference
    d -= np.diag(d.sum(axis=1))
    d *= 2.0  # on a layer of height 1
    d2 = d @ d
    inner = slice(1, points)
    # clamped: w = (1 − x²) q with q(±1) = 0 satisfies w = w' = 0
    s = np.diag(np.append(np.append(0.0, 1 / (1 - x[1:-1] ** 2)), 0.0))
    t = 2 * x  # position in the layer is (x + 1)/2
    d4 = (
        (
            np.diag(1 - x**2) @ np.linalg.matrix_power(d / 2, 4)
            - 4 * np.diag(t) @ np.linalg.matrix_power(d / 2, 3)
            - 12 * np.linalg.matrix_power(d / 2, 2)
        )
        @ s
        * 16
    )
    one = np.eye(points - 1)
    d2, d4 = d2[inner, inner], d4[inner, inner]
    a2 = number**2
    laplace = d2 - a2 * one
    bilaplace = d4 - 2 * a2 * d2 + a2 * a2 * one
    zero = np.zeros_like(one)
    left = np.block([[PRANDTL * bilaplace, -rayleigh * PRANDTL * a2 * one], [one, laplace]])
    right = np.block([[laplace, zero], [zero, one]])
    values = eig(left, right, right=False)
    return float(np.max(values.real[np.isfinite(values)]))


def growth(rayleigh, cells, length, wave_time=0.6):
    """Measured growth rate [κ/h²] of a roll of 1e-4 K."""
    air, conduction, roll = layer(rayleigh, cells, length)
    sizes = []
    with air:
        air.set(conduction + 1e-4 * roll)
        for end in (wave_time / 2, wave_time):
            while air.time * DIFFUSIVITY < end * (1 - 1e-12):
                air.advance(min(air.longest_step(), end / DIFFUSIVITY - air.time))
            sizes.append(np.max(np.abs(air.velocity[2])))
    return math.log(sizes[1] / sizes[0]) / (wave_time / 2)


def test_theory_gives_the_critical_number():
    """The eigenvalues that the flow is held against: neutral at Chandrasekhar's numbers."""
    assert abs(growth_by_theory(CRITICAL, CRITICAL_NUMBER)) < 1e-4
    assert growth_by_theory(1.02 * CRITICAL, CRITICAL_NUMBER) > 0.1
    assert growth_by_theory(0.98 * CRITICAL, CRITICAL_NUMBER) < -0.1


def test_onset_and_growth_of_convection():
    """Rigid walls, the critical wavelength: growth rates to 2 % of the span, and their zero at Ra = 1707.76.

    Extrapolated from two meshes (second order); the zero within 1 %. Negative control: the rate on the coarse
    mesh alone misses by more than that.
    """
    length = 2 * np.pi / CRITICAL_NUMBER
    numbers = (1500.0, 2200.0)
    rates = {}
    for rayleigh in numbers:
        coarse, fine = (growth(rayleigh, cells, length) for cells in ((16, 10), (32, 20)))
        rates[rayleigh] = coarse, fine + (fine - coarse) / 3
        theory = growth_by_theory(rayleigh, CRITICAL_NUMBER)
        assert abs(rates[rayleigh][1] - theory) < 0.02 * 4.0
    zeros = []
    for number in (0, 1):
        low, high = (rates[rayleigh][number] for rayleigh in numbers)
        # nearly linear in Ra: the theory's own bend is taken out
        bend = np.interp(0.0, [growth_by_theory(r, CRITICAL_NUMBER) for r in numbers], numbers) - CRITICAL
        zeros.append(float(np.interp(0.0, [low, high], numbers)) - bend)
    assert abs(zeros[1] / CRITICAL - 1) < 0.01
    assert abs(zeros[0] / CRITICAL - 1) > 0.01


def nusselt_of_rolls(cells, time):
    length = 2 * np.pi / 3.117
    air, conduction, roll = layer(1e4, cells, length)
    with air:
        air.set(conduction + 0.1 * roll)
        while air.time * DIFFUSIVITY < time:
            air.advance(air.longest_step())
        z = 0.5 * air.grid.z_widths[0]
        through_ground = (WARM - float(air.temperature[0].mean())) / z
        through_top = (float(air.temperature[-1].mean()) - COLD) / z
    assert abs(through_ground / through_top - 1) < 2e-3  # it is steady
    return through_ground


def test_steady_rolls():
    """Nu = 2.6525 at Ra = 10⁴, Pr = 0.71, wavelength 2π/3.117, to 1 %.

    Source: Fourier–Chebyshev Newton iteration, confirmed by finite differences (2.65206); R. M. Clever and
    F. H. Busse (1974), J. Fluid Mech. 65, 625–645, doi:10.1017/S0022112074001571, print 2.661.
    """
    coarse, fine = nusselt_of_rolls((24, 12), 1.0), nusselt_of_rolls((48, 24), 1.0)
    best = fine + (fine - coarse) / 3
    assert abs(best / 2.652502 - 1) < 0.01
    assert abs(coarse / 2.652502 - 1) > 0.01


def nusselt_of_cavity(rayleigh, count, time):
    """Heat through the left wall of a square cavity whose side walls are held, ground and top insulated."""
    grid = GridSpec(x=(0, 1), y=(0, 1), height=1.0, cells=(count, 1, count)).build()
    ground = FluxGround(heat_flux=Quantity(value=0.0))
    air = MovingAir(
        grid, laboratory(rayleigh, advection="central"), ground, Sides(x="insulated"),
        Top(kind="insulated"), DIFFUSIVITY, {"x": (WARM, COLD)},
    )  # fmt: skip
    with air:
        air.set((WARM - grid.x) * np.ones(grid.shape))
        while air.time * DIFFUSIVITY < time:
            air.advance(air.longest_step())
        wall = (WARM - air.temperature[:, 0, 0]) / (0.5 / count)
        other = (air.temperature[:, 0, -1] - COLD) / (0.5 / count)
    assert abs(wall.mean() / other.mean() - 1) < 5e-3
    return float(wall.mean())


@pytest.mark.parametrize(
    ("rayleigh", "expected", "counts", "time"),
    [(1e4, 2.244816, (16, 32), 0.35), (1e5, 4.521636, (28, 56), 0.2)],
)
def test_heated_cavity(rayleigh, expected, counts, time):
    """Mean Nusselt number to 1 %, extrapolated from two meshes.

    Source: Chebyshev collocation, which agrees with P. Le Quéré (1991) at 10⁶; G. de Vahl Davis (1983),
    Int. J. Numer. Methods Fluids 3, 249–264, doi:10.1002/fld.1650030305, prints 2.243 and 4.519.
    """
    coarse, fine = (nusselt_of_cavity(rayleigh, count, time) for count in counts)
    assert abs((fine + (fine - coarse) / 3) / expected - 1) < 0.01


GRID = GridSpec(x=(0, 8), y=(0, 8), height=4.0, cells=(4, 4, 8)).build()
ROUGH = Convection(ground="rough", roughness=0.01)


def test_drag_of_rough_ground():
    """τ = (k / ln(z₁/z₀))² u², against its closed form; calm air drags nothing."""
    layer_ = GroundLayer(GRID, HeldGround(temperature=Quantity(value=300.0)), ROUGH, 2.2e-5)
    u, v = np.full((4, 4), 3.0), np.full((4, 4), 4.0)
    along_x, along_y = layer_.stresses((u, u), (v, v))
    drag = (0.4 / math.log(0.25 / 0.01)) ** 2
    assert np.allclose(along_x, -drag * 5 * 3, rtol=1e-12)
    assert np.allclose(along_y, -drag * 5 * 4, rtol=1e-12)
    assert not np.any(layer_.stresses((0 * u, 0 * u), (0 * v, 0 * v))[0])


@pytest.mark.parametrize("excess", [20.0, -20.0])
def test_heat_over_rough_ground(excess):
    """Forced and free convection joined by their cubes; over cold ground the forced part alone."""
    ground = HeldGround(temperature=Quantity(value=300.0 + excess))
    layer_ = GroundLayer(GRID, ground, ROUGH, 2.2e-5)
    lowest, speed = np.full((4, 4), 300.0), np.full((4, 4), 2.0)
    flux, skin = layer_.heat(lowest, speed, 0.0, 300.0)
    forced = 0.16 * 2.0 / (math.log(25.0) * math.log(250.0))
    free = 0.15 * (9.80665 * max(excess, 0) / 300 * 2.2e-5**2 / 1.57e-5) ** (1 / 3)
    assert np.allclose(flux, (forced**3 + free**3) ** (1 / 3) * excess, rtol=1e-12)
    assert np.allclose(skin, 300.0 + excess)


def test_flux_and_exchange_find_their_skin():
    """The skin over which a given flux, or one through a resistance, flows is the one that drives it."""
    lowest, speed = np.full((4, 4), 300.0), np.full((4, 4), 1.0)
    for given in (
        FluxGround(heat_flux=Quantity(value=150.0)),
        ExchangeGround(coefficient=Quantity(value=15.0), temperature=Quantity(value=330.0)),
    ):
        flux, skin = GroundLayer(GRID, given, ROUGH, 2.2e-5).heat(lowest, speed, 0.0, 300.0)
        held = HeldGround(temperature=Quantity(value=float(skin[0, 0])))
        again, _ = GroundLayer(GRID, held, ROUGH, 2.2e-5).heat(lowest, speed, 0.0, 300.0)
        tolerance = 1e-6 if isinstance(given, FluxGround) else 0.1  # the resistance counts the skin only once
        assert abs(float(again[0, 0] / flux[0, 0]) - 1) < tolerance
        if isinstance(given, FluxGround):
            assert abs(float(flux[0, 0]) * given.heat_capacity - 150.0) < 1e-9
