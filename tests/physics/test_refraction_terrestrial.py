"""Rays near the ground of a round Earth: the horizon, curvature, ducts and mirages, against closed forms.

In air whose index is a power of the radius, n ∝ r^−m, everything is closed: n r cos θ is constant, a ray
turns by m/(1 − m) times the change of its local elevation θ, and sweeps 1/(1 − m) times that change at the
centre. Layers of it with m > 1 are ducts.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from nigemizu import trace
from nigemizu.air import refractivity

FloatArray = NDArray[np.float64]

R = 6371e3
TOP = 20e3
MINUTE = np.pi / 180 / 60

DUCTS = [
    ([0.15, 1.5, 0.15], [0.0, 50.0, 80.0]),
    ([0.15, 3.0, 0.15, 1.2, -0.3], [0.0, 50.0, 80.0, 200.0, 300.0]),
    ([2.0, 0.15], [0.0, 30.0]),
    ([-2.0, 0.5, 0.15], [0.0, 1.5, 12.0]),  # an inferior mirage under a strong inversion
]


class PowerLaws:
    """Layers of n ∝ r^−m, from `bases` [m] up."""

    top = TOP

    def __init__(self, exponents: list[float], bases: list[float]) -> None:
        self.exponents, self.bases = np.array(exponents), np.array(bases)
        self.breaks = tuple(bases[1:])
        steps = np.log1p(np.diff(self.bases) / (R + self.bases[:-1]))
        self.logs = np.log(1.0003) - np.concatenate([[0.0], np.cumsum(self.exponents[:-1] * steps)])

    def __call__(self, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        height = np.asarray(height, dtype=np.float64)
        layer = np.clip(np.searchsorted(self.bases, height, side="right") - 1, 0, len(self.bases) - 1)
        power, base = self.exponents[layer], self.bases[layer]
        excess = np.expm1(self.logs[layer] - power * np.log1p((height - base) / (R + base)))
        return excess, -power * (1.0 + excess) / (R + height)

    def climb(self, height: float, eye: float) -> float:
        """ln(n r) less that at the eye."""
        above, here = (np.log1p(float(self(np.asarray(h))[0])) for h in (height, eye))
        return float(above - here + np.log1p((height - eye) / (R + eye)))

    def turned(self, elevation: float, eye: float) -> tuple[float, float]:
        """Refraction and geocentric angle of a ray from the eye, in closed form; NaN if it never gets out."""
        cuts = sorted({0.0, eye, *self.breaks, TOP})
        sine2 = {
            h: np.sin(elevation) ** 2 - np.cos(elevation) ** 2 * np.expm1(-2 * self.climb(h, eye))
            for h in cuts
        }
        if any(sine2[h] <= 0 for h in cuts if h > eye):
            return np.nan, np.nan
        pieces = [(low, high, 1) for low, high in pairwise(cuts) if low >= eye]
        below = [h for h in cuts if h < eye]
        if elevation < 0:
            floor = [h for h in below if sine2[h] <= 0]
            if not floor:
                return np.nan, np.nan
            pieces += [(low, high, 2) for low, high in pairwise(cuts) if floor[-1] <= low < eye]
        lifted = swept = 0.0
        for low, high, times in pieces:
            start, end = (np.arcsin(np.sqrt(max(sine2[h], 0.0))) for h in (low, high))
            power = self.exponents[np.searchsorted(self.bases, 0.5 * (low + high)) - 1]
            lifted += times * power / (1 - power) * (end - start)
            swept += times / (1 - power) * (end - start)
        return lifted, swept


@pytest.mark.parametrize(("exponents", "bases"), DUCTS)
def test_ducts_in_closed_form(exponents: list[float], bases: list[float]) -> None:
    """Rays through, over, under and inside ducts, and those that turn in one; trapped ones are NaN."""
    air = PowerLaws(exponents, bases)
    up = np.array([0, 1e-6, 1e-4, 5e-4, 9e-4, 1.2e-3, 2e-3, 0.01, 0.1, 1.5])
    elevations = np.concatenate([-up[1:8], up])
    for eye in (0.0, 10.0, 60.0, 75.0, 100.0, 400.0):
        rays = trace.refracted_rays(air, elevations, radius=R, observer_height=eye, tolerance=1e-12)
        exact = np.array([air.turned(e, eye) for e in elevations])
        np.testing.assert_array_equal(np.isnan(rays.refraction), np.isnan(exact[:, 0]))
        np.testing.assert_array_equal(rays.status != trace.RefractionStatus.ESCAPED, np.isnan(exact[:, 0]))
        good = ~np.isnan(exact[:, 0])
        assert good.sum() >= 3
        np.testing.assert_allclose(rays.refraction[good], exact[good, 0], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(rays.geocentric_angle[good], exact[good, 1], rtol=1e-9, atol=1e-12)


def test_a_duct_traps_what_is_nearly_level_in_it() -> None:
    """In a layer with m = 1.5 up to 80 m a ray gets out if cos θ < n r at its top over n r at the eye."""
    air = PowerLaws(*DUCTS[0])
    edge = np.arccos(np.exp(air.climb(80.0, 60.0)))
    assert 1e-4 < edge < 2e-3
    seen = trace.refracted_rays(
        air, edge * np.array([-0.5, 0.5, 1 - 1e-6, 1 + 1e-6]), radius=R, observer_height=60
    )
    assert seen.status.tolist() == [trace.RefractionStatus.TRAPPED] * 3 + [trace.RefractionStatus.ESCAPED]
    assert "duct" in trace.RefractionStatus.TRAPPED.message
    # near the edge the ray creeps along the top of the duct: the exact sum knows how far
    assert seen.refraction[-1] == pytest.approx(air.turned(edge * (1 + 1e-6), 60.0)[0], rel=1e-6, abs=0)


def test_a_level_layer_with_k_of_one() -> None:
    """n ∝ 1/r: θ stays, and the ray turns by ln(r₁/r₀) cot θ."""
    air = PowerLaws([1.0, 0.15], [0.0, 40.0])
    elevation = np.array([1e-3, 0.02, 0.5])
    above = np.array([air.turned(e, 40.0)[0] for e in elevation])
    lifted = trace.astronomical_refraction(air, elevation, radius=R, tolerance=1e-13)
    np.testing.assert_allclose(lifted - above, np.log1p(40.0 / R) / np.tan(elevation), rtol=1e-7, atol=0)


def test_dip_and_distance_of_the_horizon() -> None:
    """US Standard Atmosphere 1976 at 550 nm, R = 6371 km, by a quadrature of another program.

    Below 11 km the air is a polytrope in geopotential height; the rays meet no other.
    """
    surface = float(refractivity(288.15, 101325.0, wavelength=550e-9))

    def air(height: FloatArray) -> tuple[FloatArray, FloatArray]:
        geopotential = 6356766.0 * height / (6356766.0 + height)
        power = 9.80665 * 28.9644 / 8314.32 / 6.5e-3 - 1.0
        warmth = 1.0 - 6.5e-3 * geopotential / 288.15
        excess = surface * warmth**power
        slope = -power * 6.5e-3 / 288.15 / warmth * (6356766.0 / (6356766.0 + height)) ** 2
        return excess, slope * excess

    heights = [1.5, 10.0, 100.0, 1000.0]
    seen = trace.horizon(air, heights, radius=R)
    dips = [2.149322397943376, 5.549701226161147, 17.55553306048125, 55.69652812717193]
    np.testing.assert_allclose(seen.dip / MINUTE, dips, rtol=0, atol=1e-6)
    distances = [4.798385408226993, 12.389239318909743, 39.17358187958117, 123.73311471134211]
    np.testing.assert_allclose(seen.distance / 1e3, distances, rtol=0, atol=1e-4)
    # the ray of the dip grazes the sea: a hair higher passes, a hair lower hits
    near = -seen.dip[2] * np.array([1 - 1e-9, 1 + 1e-9])
    rays = trace.refracted_rays(air, near, radius=R, observer_height=100.0, top=10e3)
    assert rays.status.tolist() == [trace.RefractionStatus.ESCAPED, trace.RefractionStatus.HIT]
    assert 0 <= rays.lowest[0] < 1e-5


def test_horizon_without_air() -> None:
    """cos(dip) = R/(R + h); the distance is R times it."""
    heights = np.array([0.0, 1.5, 10.0, 100.0, 1000.0])
    seen = trace.horizon(lambda h: (0.0 * h, 0.0 * h), heights, radius=R)
    dips = [0.0, 2.3590147969242863, 6.0909466286840885, 19.261151081518122, 60.90552301186879]
    np.testing.assert_allclose(seen.dip / MINUTE, dips, rtol=1e-11, atol=0)  # by an arccos
    np.testing.assert_allclose(
        seen.dip, np.arctan(np.sqrt(heights * (2 * R + heights)) / R), rtol=1e-14, atol=0
    )
    np.testing.assert_allclose(seen.distance, R * seen.dip, rtol=1e-10, atol=0)


def test_horizon_behind_a_duct_is_nowhere() -> None:
    duct = trace.horizon(PowerLaws([2.0, 0.15], [0.0, 30.0]), [10.0, 35.0], radius=R)
    assert np.isnan(duct.dip).all()
    assert np.isnan(duct.distance).all()
    # k = 0.15 all the way: as over a sphere of R/(1 − k)
    plain = trace.horizon(PowerLaws([0.15], [0.0]), 10.0, radius=R)
    assert plain.dip == pytest.approx(np.sqrt(2 * 10.0 * 0.85 / R), rel=1e-5, abs=0)
    assert plain.distance == pytest.approx(np.sqrt(2 * 10.0 / 0.85 * R), rel=1e-5, abs=0)


def test_refraction_coefficient() -> None:
    """k = m of a power law; in real air k = 503 p/T² (0.0343 + dT/dz), p in hPa.

    C. Hirt et al., J. Geophys. Res. 115 (2010) D21102, doi:10.1029/2010JD014067; compared at 570 nm, within
    1.5 %.
    """
    air = PowerLaws([0.15, 3.0], [0.0, 50.0])
    np.testing.assert_allclose(
        trace.refraction_coefficient(air, [10.0, 60.0], radius=R), [0.15, 3.0], rtol=1e-12, atol=0
    )
    surface = refractivity(288.15, 101325.0, wavelength=np.array([570e-9, 900e-9]))
    for lapse in (-0.0065, 0.2, -0.5):

        def real(height: FloatArray, lapse: float = lapse) -> tuple[FloatArray, FloatArray]:
            power = -9.80665 / 287.053 / lapse - 1.0
            warmth = 1.0 + lapse * height / 288.15
            excess = surface * warmth**power
            return excess, power * lapse / 288.15 / warmth * excess

        found = trace.refraction_coefficient(real, 0.0, radius=R)
        assert found.shape == (2,)
        assert found[0] == pytest.approx(503 * 1013.25 / 288.15**2 * (0.0343 + lapse), rel=0.015, abs=0)
        assert 0.98 < found[1] / found[0] < 0.995  # the infrared bends less


def test_lengths_of_rays_in_closed_form() -> None:
    """n ∝ r^−½: r = A/cos²θ, so that s = A [sec θ tan θ + asinh tan θ] and ∫ n ds = 2 n r cos θ tan θ."""
    air = PowerLaws([0.5], [0.0])
    elevation, eye = np.array([0.0, 0.003, 0.1, 1.0, -0.01]), 1000.0
    rays = trace.refracted_rays(air, elevation, radius=R, observer_height=eye, tolerance=1e-13)
    here, over = float(air(np.asarray(eye))[0]), float(air(np.asarray(TOP))[0])
    invariant = (1 + here) * (R + eye) * np.cos(elevation)
    size = (R + eye) * np.cos(elevation) ** 2
    leaving = np.arccos(invariant / (1 + over) / (R + TOP))

    def length(angle: FloatArray) -> FloatArray:
        return size * (np.tan(angle) / np.cos(angle) + np.arcsinh(np.tan(angle)))

    path = length(leaving) - length(elevation)
    optical = 2 * invariant * (np.tan(leaving) - np.tan(elevation))
    np.testing.assert_allclose(rays.path_length, path, rtol=1e-9, atol=0)
    np.testing.assert_allclose(rays.path_length + rays.excess_path, optical, rtol=1e-9, atol=0)
    assert rays.lowest[4] == pytest.approx(size[4] - R, rel=1e-9, abs=0)  # θ = 0: r = A
    assert rays.lowest[:4].tolist() == [eye] * 4


def inversion(height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """An exponential atmosphere with a smooth, ducting step of n around 60 m."""
    excess = 2.8e-4 * np.exp(-height / 8e3)
    step = np.tanh((height - 60.0) / 5.0)
    return excess - 3e-6 * (1 + step), -excess / 8e3 - 6e-7 * (1 - step**2)


def test_a_smooth_duct_against_the_differential_equation() -> None:
    """Rays along the arc s by SciPy: dh = sin θ ds, dθ = cos θ (1/r + n'/n) ds, dR = −cos θ n'/n ds.

    No breaks are given, and the air is 5 km high: the duct of a few metres must be found.
    """

    def change(_: float, y: FloatArray) -> list[FloatArray]:
        excess, slope = inversion(y[0])
        pull = slope / (1 + excess)
        level = np.cos(y[1])
        return [np.sin(y[1]), level * (1 / (R + y[0]) + pull), -level * pull, level / (R + y[0]), excess]

    def out(_: float, y: FloatArray) -> float:
        return float(y[0] - 5000.0)

    out.terminal = True  # type: ignore[attr-defined]
    elevations = np.array([-0.0021, -0.001, 0.0, 0.0004, 0.003])
    for eye in (20.0, 75.0):
        rays = trace.refracted_rays(
            inversion, elevations, radius=R, observer_height=eye, top=5e3, tolerance=1e-12
        )
        assert (rays.status == trace.RefractionStatus.ESCAPED).sum() >= (1 if eye < 60 else 4)
        for number in np.flatnonzero(rays.status == trace.RefractionStatus.ESCAPED):
            path = solve_ivp(
                change,
                (0, 1e6),
                [eye, elevations[number], 0, 0, 0],
                method="DOP853",
                rtol=1e-13,
                atol=[1e-9, 1e-15, 1e-15, 1e-15, 1e-12],
                events=out,
            )
            lifted, angle, excess_path = path.y_events[0][0][2:]
            assert rays.refraction[number] == pytest.approx(lifted, rel=0, abs=1e-9)
            assert rays.geocentric_angle[number] == pytest.approx(angle, rel=0, abs=1e-9)
            assert rays.path_length[number] == pytest.approx(path.t_events[0][0], rel=0, abs=1e-2)
            assert rays.excess_path[number] == pytest.approx(excess_path, rel=0, abs=1e-5)


def test_wavelengths_that_a_duct_parts() -> None:
    """Some wavelengths turn in the duct, others pass through it: each as if it were alone."""
    shares = np.array([0.1, 0.2, 0.21, 0.5, 1.0])  # of the step of n, of which 0.204 makes a duct

    def coloured(height: FloatArray, share: FloatArray = shares) -> tuple[FloatArray, FloatArray]:
        with_step, slope = inversion(height)
        plain = 2.8e-4 * np.exp(-height / 8e3)
        return plain + share * (with_step - plain), -plain / 8e3 + share * (slope + plain / 8e3)

    elevations = np.array([-0.002, -0.001, -5e-4, -1e-4, 0.0, 2e-4, 6e-4, 0.002])
    for eye in (10.0, 58.0, 64.0, 90.0):
        given = {"radius": R, "observer_height": eye, "top": TOP, "tolerance": 1e-11}
        together = trace.refracted_rays(coloured, elevations, **given)
        for number, share in enumerate(shares):
            alone = trace.refracted_rays(lambda h, s=share: coloured(h, s), elevations, **given)
            np.testing.assert_array_equal(together.status[:, number], alone.status)
            np.testing.assert_allclose(
                together.refraction[:, number], alone.refraction, rtol=1e-8, atol=1e-10
            )
            np.testing.assert_allclose(together.lowest[:, number], alone.lowest, rtol=0, atol=1e-6)


def test_what_no_break_tells_is_found() -> None:
    """The same rays whether or not the kinks and steps of an index are given as breaks."""
    elevations = np.array([-0.0021, -0.0008, 0.0, 2e-4, 0.001, 0.01, 0.3])
    kinked = PowerLaws([-2.0, 0.5, 3.0, 0.15], [0.0, 1.5, 40.0, 50.0])
    for index, cuts in ((kinked, kinked.breaks), (inversion, np.linspace(20, 100, 41))):
        for eye in (5.0, 75.0):
            told, untold = (
                trace.refracted_rays(index, elevations, radius=R, observer_height=eye, top=TOP, breaks=given)
                for given in (cuts, ())
            )
            np.testing.assert_array_equal(told.status, untold.status)
            np.testing.assert_allclose(told.refraction, untold.refraction, rtol=0, atol=3e-9)
