"""The surface layer: its functions, its profile, its fluxes, its signs, and a hot road."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

from nigemizu import InputError
from nigemizu.air import SurfaceFluxes, SurfaceLayer, psi_heat, psi_momentum, similarity

KAPPA, GRAVITY, GAS = 0.4, 9.80665, 287.053
CP = 3.5 * GAS
LAPSE = GRAVITY / CP

ROAD = SurfaceLayer(ground_temperature=330.0, air_temperature=305.0, wind=3.0, roughness=0.002)
COLD_SEA = SurfaceLayer(ground_temperature=280.0, air_temperature=284.0, wind=6.0, heat_roughness=1e-4)
LAYERS = pytest.mark.parametrize("layer", [ROAD, COLD_SEA], ids=["unstable", "stable"])


def phi_momentum(zeta: float) -> float:
    """Dyer (1974, doi:10.1007/BF00240838); beyond ζ = 1 Webb (1970, doi:10.1002/qj.49709640708)."""
    return (1 - 16 * zeta) ** -0.25 if zeta < 0 else min(1 + 5 * zeta, 6.0)


def phi_heat(zeta: float) -> float:
    return (1 - 16 * zeta) ** -0.5 if zeta < 0 else min(1 + 5 * zeta, 6.0)


def quadrature(phi: Callable[[float], float], zeta: float) -> float:
    """∫ (1 − φ)/ζ′ dζ′ from 0, in pieces that keep clear of φ's corner at 1."""
    ends = [0.0, *(math.copysign(e, zeta) for e in (0.01, 0.1, 1.0, 10.0) if e < abs(zeta)), zeta]
    pieces = (quad(lambda t: (1 - phi(t)) / t, a, b, epsabs=1e-13)[0] for a, b in itertools.pairwise(ends))
    return math.fsum(pieces)


def potential(layer: SurfaceLayer, z: NDArray[np.float64] | float) -> NDArray[np.float64]:
    return layer.temperature(z) + LAPSE * np.asarray(z)


def slope(layer: SurfaceLayer, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """dθ/dz by the five-point formula, whose error here is 1e-9 of it."""
    h = 5e-3 * z
    inner = potential(layer, z + h) - potential(layer, z - h)
    outer = potential(layer, z + 2 * h) - potential(layer, z - 2 * h)
    return np.asarray((8 * inner - outer) / (12 * h))


ZETAS = (-100.0, -10.0, -1.0, -0.1, -1e-3, 1e-3, 0.3, 1.0, 2.0, 6.0)


@pytest.mark.parametrize("zeta", ZETAS)
def test_psi_is_the_integral_of_phi(zeta: float) -> None:
    assert float(psi_momentum(zeta)) == pytest.approx(quadrature(phi_momentum, zeta), rel=0, abs=1e-10)
    assert float(psi_heat(zeta)) == pytest.approx(quadrature(phi_heat, zeta), rel=0, abs=1e-10)


@pytest.mark.parametrize(("name", "value", "zeta"), [("UNSTABLE", 20.0, -1.0), ("STABLE", 4.7, 0.3)])
def test_other_constants_give_other_integrals(
    monkeypatch: pytest.MonkeyPatch, name: str, value: float, zeta: float
) -> None:
    monkeypatch.setattr(similarity, name, value)
    assert abs(float(psi_momentum(zeta)) - quadrature(phi_momentum, zeta)) > 0.05
    assert abs(float(psi_heat(zeta)) - quadrature(phi_heat, zeta)) > 0.05


def nearly_neutral(rise: float) -> SurfaceLayer:
    """Δθ of `rise` K between ground and 2 m in a wind of 100 m/s: |z/L| is about 1e-6."""
    return SurfaceLayer(ground_temperature=288.15, air_temperature=288.15 - 2 * LAPSE + rise, wind=100.0)


@pytest.mark.parametrize("rise", [1e-3, -1e-3])
def test_neutral_air_keeps_the_logarithmic_law(rise: float) -> None:
    layer, z = nearly_neutral(rise), np.geomspace(1e-4, 10.0, 30)
    expected = rise * np.log(z / 2e-5) / math.log(2.0 / 2e-5)
    np.testing.assert_allclose(potential(layer, z) - 288.15, expected, rtol=1e-5)
    assert layer.fluxes.friction_velocity == pytest.approx(KAPPA * 100.0 / math.log(10.0 / 2e-4), rel=1e-5)
    assert abs(layer.fluxes.obukhov_length) > 1e6


def test_no_difference_carries_no_heat() -> None:
    ground = 288.15
    fluxes = SurfaceLayer(
        ground_temperature=ground, air_temperature=ground, wind=5.0, air_height=1e-3
    ).fluxes  # 1 mm up: the adiabat falls by 1e-5 K
    assert abs(fluxes.heat_flux) < 1e-2
    still = similarity.solve(temperature_difference=0.0, air_temperature=288.0, wind=5.0)
    assert still.heat_flux == 0.0
    assert still.obukhov_length == math.inf
    assert still.friction_velocity == pytest.approx(0.4 * 5.0 / math.log(5e4), rel=1e-14)


def test_another_karman_constant_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(similarity, "VON_KARMAN", 0.35)
    found = nearly_neutral(1e-3).fluxes.friction_velocity
    assert found < 0.9 * KAPPA * 100.0 / math.log(10.0 / 2e-4)


def test_the_sublayer_is_the_tangent_from_the_ground() -> None:
    """In neutral air it touches ln(z/zh) at e·zh, where the curve has risen by θ*/κ."""
    layer, top = nearly_neutral(-1e-3), math.e * 2e-5
    step = layer.fluxes.temperature_scale / KAPPA
    z = np.array([0.0, 0.25, 0.5, 1.0]) * top
    np.testing.assert_allclose(potential(layer, z) - 288.15, step * z / top, rtol=1e-6, atol=1e-12)


@LAYERS
def test_gradient_is_phi_over_kappa_z(layer: SurfaceLayer) -> None:
    fluxes, z = layer.fluxes, np.array([2e-3, 1e-2, 0.1, 1.0, 2.0, 10.0, 50.0, 200.0])
    phi = np.array([phi_heat(zeta) for zeta in z / fluxes.obukhov_length])
    assert np.abs(z / fluxes.obukhov_length).max() > 2.0  # well into the strongly stratified ranges
    np.testing.assert_allclose(slope(layer, z), phi * fluxes.temperature_scale / (KAPPA * z), rtol=1e-6)


def test_another_gamma_fails_the_gradient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(similarity, "UNSTABLE", 20.0)
    fluxes, z = ROAD.fluxes, np.array([2.0])
    expected = phi_heat(2.0 / fluxes.obukhov_length) * fluxes.temperature_scale / (KAPPA * z)
    assert abs(slope(ROAD, z) / expected - 1.0)[0] > 0.05


@LAYERS
def test_fluxes_give_the_profile_back(layer: SurfaceLayer) -> None:
    fluxes, z = layer.fluxes, np.geomspace(1e-6, 100.0, 60)
    given: dict[str, float] = layer.model_dump(exclude={"ground_temperature", "wind"}, exclude_none=True)
    back = SurfaceLayer(
        **{**given, "heat_flux": fluxes.heat_flux, "friction_velocity": fluxes.friction_velocity}
    )
    np.testing.assert_allclose(back.fluxes, fluxes, rtol=1e-8)
    difference = abs(float(layer.temperature(0.0)) - layer.air_temperature)
    np.testing.assert_allclose(back.temperature(z), layer.temperature(z), rtol=0, atol=1e-8 * difference)
    there = SurfaceLayer(**{**given, "ground_temperature": float(back.temperature(0.0)), "wind": layer.wind})
    np.testing.assert_allclose(there.fluxes, fluxes, rtol=1e-8)


@LAYERS
def test_profile_passes_through_what_was_given(layer: SurfaceLayer) -> None:
    assert float(layer.temperature(0.0)) == pytest.approx(layer.ground_temperature, rel=0, abs=1e-12)
    assert float(layer.temperature(2.0)) == pytest.approx(layer.air_temperature, rel=0, abs=1e-10)


def wind_of(fluxes: SurfaceFluxes) -> float:
    """Wind at 10 m over the roughness 2e-4 m, its profile integrated."""

    def gradient(log: float) -> float:
        return phi_momentum(math.exp(log) / fluxes.obukhov_length)

    corner = [math.log(fluxes.obukhov_length)] if 2e-4 < fluxes.obukhov_length < 10.0 else None
    span = quad(gradient, math.log(2e-4), math.log(10.0), epsabs=1e-12, limit=200, points=corner)[0]
    return float(fluxes.friction_velocity / KAPPA * span)


@pytest.mark.parametrize("wind", [0.05, 0.5, 3.0, 30.0])
@pytest.mark.parametrize("difference", [-60.0, -5.0, -1e-3])
def test_every_unstable_case_is_solved(wind: float, difference: float) -> None:
    fluxes = similarity.solve(temperature_difference=difference, air_temperature=300.0, wind=wind)
    assert wind_of(fluxes) == pytest.approx(wind, rel=1e-8)
    theta = 300.0 + 2 * LAPSE
    length = fluxes.friction_velocity**2 * theta / (KAPPA * GRAVITY * fluxes.temperature_scale)
    assert fluxes.obukhov_length == pytest.approx(length, rel=1e-9)


def test_stable_cases_are_solved_up_to_the_limit_and_refused_beyond() -> None:
    """Webb (1970) observed z/L up to 6."""

    def solved(difference: float) -> SurfaceFluxes:
        return similarity.solve(temperature_difference=difference, air_temperature=290.0, wind=4.0)

    differences = np.geomspace(0.01, 30.0, 60)
    ratios = []
    for difference in differences:
        try:
            fluxes = solved(difference)
        except InputError:
            break
        assert wind_of(fluxes) == pytest.approx(4.0, rel=1e-8)
        ratios.append(10.0 / fluxes.obukhov_length)
    assert 4.0 < ratios[-1] <= 6.0
    assert np.all(np.diff(ratios) > 0.0)
    assert len(ratios) < len(differences)
    for difference in differences[len(ratios) :]:
        with pytest.raises(InputError, match="Richardson"):
            solved(difference)


def test_hot_ground_warms_and_cold_ground_cools() -> None:
    hot, cold = ROAD.fluxes, COLD_SEA.fluxes
    assert hot.temperature_scale < 0.0
    assert hot.obukhov_length < 0.0
    assert hot.heat_flux > 0.0
    assert cold.temperature_scale > 0.0
    assert cold.obukhov_length > 0.0
    assert cold.heat_flux < 0.0
    z = np.geomspace(1e-5, 20.0, 100)
    assert np.all(np.diff(potential(ROAD, z)) < 0.0)
    assert np.all(np.diff(potential(COLD_SEA, z)) > 0.0)
    density = 101325.0 / (GAS * 305.0)
    expected = -density * CP * hot.friction_velocity * hot.temperature_scale
    assert hot.heat_flux == pytest.approx(expected, rel=1e-12)


def test_free_convection_follows_the_chosen_power() -> None:
    """φh ∝ ζ^(−1/2) makes dθ/dz fall as z^(−3/2), not as the z^(−4/3) of dimensional analysis."""
    layer = SurfaceLayer(heat_flux=300.0, friction_velocity=0.05, air_temperature=300.0)
    z = 2000.0 * -layer.fluxes.obukhov_length * np.array([1.0, 2.0])
    power = np.diff(np.log(-slope(layer, z)))[0] / math.log(2.0)
    assert -1.50001 < power < -1.4999
    assert power < -4 / 3 - 0.1


def steps_of_slope(z: NDArray[np.float64], value: NDArray[np.float64]) -> float:
    gradient = np.diff(value) / np.diff(z)
    return float(np.abs(np.diff(np.log(np.abs(gradient)))).max())


@LAYERS
def test_gradient_never_jumps(layer: SurfaceLayer) -> None:
    """Neighbouring slopes differ by the step in height, 1e-3 of it, times a power of at most 3."""
    faded = layer.model_copy(update={"blending_height": 20.0})
    z = np.exp(np.arange(math.log(1e-6), math.log(60.0), 1e-3))
    assert steps_of_slope(z, potential(faded, z)) < 4e-3
    kinked = np.where(z < 1e-3, 0.0, np.log(z / 1e-3)) + 1e-6 * z
    assert steps_of_slope(z, kinked) > 1.0


def test_layer_fades_into_well_mixed_air() -> None:
    faded = ROAD.model_copy(update={"blending_height": 20.0})
    z = np.array([0.0, 0.01, 2.0, 19.0])
    np.testing.assert_allclose(faded.temperature(z), ROAD.temperature(z), rtol=1e-15)
    z = np.array([0.0, 1.0, 25.0, 100.0, 1000.0])
    mixed = faded.temperature(z) - faded.departure(z) + LAPSE * z
    np.testing.assert_allclose(mixed, mixed[0], rtol=1e-14)
    assert float(faded.departure(0.0)) > 20.0
    assert abs(float(faded.departure(1000.0))) < 1e-12
    ratio = faded.departure(40.0) / faded.departure(20.0)
    assert float(ratio) == pytest.approx(math.exp(-1.0), rel=1e-9)


def test_hot_road_is_as_steep_as_roads_that_were_measured() -> None:
    """Asphalt at the hour of greatest heat: of the order of 20–30 K in the first centimetre, 1–2 K/cm above.

    Abstract of "Surface convection and the distribution of temperature near a heated surface",
    discovery.researcher.life/article/…/4da5359b0e6c34ebb5f5043b45a46aef. Cooler or windier roads are less
    steep: hence the lower bounds.
    """
    first = float(ROAD.temperature(0.0) - ROAD.temperature(0.01))
    assert 1.0 < first < 30.0
    above = float(ROAD.temperature(0.01) - ROAD.temperature(0.1)) / 9.0
    assert 0.3 < above < 2.0
    assert first > 5.0 * above  # the skin stands out from what is above it
