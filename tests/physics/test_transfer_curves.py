"""Transfer curves, the horizon and refraction through the tables, against independent numbers.

Where a number was computed for these tests by another program, the air stands beside it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from nigemizu import field, trace
from nigemizu.air import density, refractivity, standard_atmosphere
from nigemizu.render import select_variant
from nigemizu.scene import Scene
from nigemizu.scene.far_air import FarAir, medium
from nigemizu.scene.measuring import TransferCurve, horizon_table, refraction_table, transfer_curve
from nigemizu.scene.measuring.index import SceneIndex
from nigemizu.scene.measuring.transfer import curve_through
from nigemizu.scene.measuring.transfer_rays import flight_through

FloatArray = NDArray[np.float64]

MINUTE = math.pi / 180 / 60
SECOND = MINUTE / 60

# ---- a road mirage over asphalt
# T = 308.168 + 6.37 exp(−10.08 h) K and n = 1 + 7.86e-4·101/T, the 'conventional' fit of measurements over
# asphalt (Horváth et al. 2023), seen from 1.2 m over a flat Earth. Two independent integrators agree to
# 3e-10 m.

HEIGHT_AT_500_M = [
    0.9092409349804159,
    0.6189739252595535,
    0.3336197571947891,
    0.09430189437829967,
    0.06417386919454562,
]
GROUND_HIT_M = [365.154000310489, 305.37817750549135, 264.3289758952179, 233.49241138439015, 209.291456283213]
CRITICAL_ARCMIN = 11.103074315640116


def asphalt(tolerance: float) -> TransferCurve:
    air = field.ExponentialTemperature(field.types("llvm", "double"))
    flight = flight_through(air, (0.0, 0.0, 1.2), distance=500.0, tolerance=tolerance)
    minutes = -np.arange(2.0, 21.0, 2.0)
    return curve_through(flight, minutes / 60, 500.0, eye=1.2, tolerance=tolerance)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-7, 1e-8])
def test_asphalt_heights_keep_the_tolerance(tolerance: float) -> None:
    curve = asphalt(tolerance)
    assert curve.height[:5] == pytest.approx(HEIGHT_AT_500_M, rel=0, abs=tolerance)
    assert np.all(np.isnan(curve.height[5:]))
    assert np.all(np.isnan(curve.ground_distance[:5]))
    # the ground is met on chords, by rays of 1 mrad and steeper
    assert curve.ground_distance[5:] == pytest.approx(GROUND_HIT_M, rel=0, abs=3e4 * tolerance)


def test_asphalt_images() -> None:
    """Two images between the fold and the critical angle (Snell's law), the lower of them inverted."""
    curve = asphalt(1e-8)
    inverted, erect = curve.bands
    assert -inverted.low / MINUTE == pytest.approx(CRITICAL_ARCMIN, rel=0, abs=1e-4)
    assert (inverted.erect, erect.erect) == (False, True)
    assert [fold.kind for fold in curve.folds] == ["lowest"]
    assert -10.0 < curve.folds[0].elevation / MINUTE < -8.0
    assert curve.folds[0].height < HEIGHT_AT_500_M[-1]
    assert curve.images.tolist() == [1, 1, 1, 2, 2, 0, 0, 0, 0, 0]
    assert curve.magnification[4] < 0 < curve.magnification[3]


def test_asphalt_slopes_are_those_of_the_curve() -> None:
    """dh/de against a parabola through three rays a hundredth of a minute apart."""
    air = field.ExponentialTemperature(field.types("llvm", "double"))
    flight = flight_through(air, (0.0, 0.0, 1.2), distance=500.0, tolerance=1e-9)
    curve = curve_through(flight, [-10.0 / 60, -8.0 / 60], 500.0, eye=1.2, tolerance=1e-9)
    step = 0.01 * MINUTE
    for elevation, slope in zip(np.radians(curve.elevation), curve.slope, strict=True):
        below, above = flight(np.array([elevation - step, elevation + step])).height
        assert slope == pytest.approx((above - below) / (2 * step), rel=2e-3)


# ---- the standard atmosphere over a round Earth


def standard(wavelength: float, *, proportional: bool = False, eye: float = 0.0, more: str = "") -> Scene:
    """US 1976 over 6371 km; `proportional`: n − 1 is a multiple of the density, at the ground Ciddor's."""
    law = ""
    if proportional:
        at_ground = float(refractivity(288.15, 101325.0, wavelength=wavelength))
        constant = at_ground / float(density(288.15, 101325.0))
        law = f'model = "gladstone-dale"\ngladstone_dale_constant = {constant!r}'
    return Scene.from_toml(
        f"""
        [earth]
        radius = 6371000.0
        [profile]
        kind = "us1976"
        {more}
        [air]
        wavelength = {wavelength!r}
        {law}
        [tracer]
        method = "bent"
        [camera]
        eye = [0.0, 0.0, {eye!r}]
        field_of_view = 3.0
        """.replace("        ", "")
    )


EYES = [1.5, 10.0, 100.0, 1000.0]
DIP_ARCMIN = np.array([2.149322397943376, 5.549701226161147, 17.55553306048125, 55.69652812717193])
DISTANCE_KM = np.array([4.798385408226993, 12.389239318909743, 39.17358187958817, 123.73311471134211])


def test_dip_and_distance_of_the_horizon() -> None:
    """550 nm, n − 1 a multiple of the density, by a quadrature of another program."""
    table = horizon_table(standard(550e-9, proportional=True), EYES)
    np.testing.assert_allclose(table.dip / MINUTE, DIP_ARCMIN, rtol=0, atol=2e-6)
    np.testing.assert_allclose(table.distance / 1e3, DISTANCE_KM, rtol=0, atol=5e-6)
    # k = −(R + h)/n dn/dh from −dρ/dh/ρ = g/(R_d T) + (dT/dh)/T at the ground
    fall = 9.80665 / (8.31432 / 0.0289644 * 288.15) - 6.5e-3 / 288.15
    excess = float(refractivity(288.15, 101325.0, wavelength=550e-9))
    ground = horizon_table(standard(550e-9, proportional=True), [0.0])
    coefficient = 6371e3 * excess * fall / (1 + excess)
    assert ground.refraction_coefficient[0] == pytest.approx(coefficient, rel=2e-6, abs=0)
    assert ground.effective_radius[0] == pytest.approx(1 / (1 - coefficient), rel=1e-6, abs=0)
    assert (ground.dip[0], ground.distance[0]) == (0.0, 0.0)
    exact = np.arccos(6371e3 / (6371e3 + np.array(EYES, dtype=np.longdouble)))
    np.testing.assert_allclose(table.geometric_dip, exact.astype(np.float64), rtol=1e-9, atol=0)


def test_real_air_dips_a_little_more() -> None:
    """Ciddor's air is a real gas: denser than its pressure says at the ground, by 4e-4, and less so aloft.

    Its index falls off by some 0.05 % less steeply, which makes 1e-5 to 3e-5 of the dip.
    """
    table = horizon_table(standard(550e-9), EYES)
    share = (table.dip / MINUTE - DIP_ARCMIN) / DIP_ARCMIN
    assert np.all((share > 1e-5) & (share < 3e-5))


def test_refraction_of_the_standard_atmosphere() -> None:
    """590 nm: 1975.249486066035″ at the horizon, n − 1 a multiple of the density, by another program."""
    table = refraction_table(standard(590e-9, proportional=True), [0.0, 1.0, 10.0, 45.0])
    expected = np.array([1975.249486066035, 1408.8799392552091, 312.5375207263982, 57.02044056557313])
    assert np.all(np.abs(table.refraction[:, 0] / SECOND - expected) < 1e-3)
    assert table.true_elevation[0, 0] == pytest.approx(-1975.249486066035 / 3600, rel=0, abs=1e-6)


def test_refraction_of_real_air() -> None:
    """Ciddor's law at the temperatures and pressures of the standard, in closed form and one by one."""
    wavelength = np.array([400e-9, 590e-9, 700e-9])
    table = refraction_table(standard(590e-9), [0.0, 0.5, 5.0, 45.0], wavelength)

    def air(height: FloatArray) -> tuple[FloatArray, FloatArray]:
        def excess(h: FloatArray) -> FloatArray:
            h = np.clip(h, 0.0, 86e3)
            temperature, pressure, _ = standard_atmosphere(h)
            return refractivity(temperature, pressure, wavelength=wavelength)

        height = np.asarray(height, dtype=np.float64)
        # one-sided at the ends, where the standard has none beyond
        up, down = np.minimum(height + 0.05, 86e3), np.maximum(height - 0.05, 0.0)
        return excess(height), (excess(up) - excess(down)) / (up - down)

    geopotential = np.array([11e3, 20e3, 32e3, 47e3, 51e3, 71e3])
    breaks = 6356766.0 * geopotential / (6356766.0 - geopotential)
    lifted = trace.astronomical_refraction(
        air, np.radians([0.0, 0.5, 5.0, 45.0]), radius=6371e3, top=86e3, breaks=breaks, into_vacuum=True
    )
    np.testing.assert_allclose(table.refraction / SECOND, lifted / SECOND, rtol=0, atol=0.01)
    spread = (table.refraction[0, 0] - table.refraction[0, 2]) / SECOND
    assert spread == pytest.approx(53.917764, rel=0, abs=0.01)  # by another program
    # 0.13″ less than without the compressibility
    assert 1975.249486 - table.refraction[0, 1] / SECOND == pytest.approx(0.13, rel=0, abs=0.01)


@pytest.mark.parametrize("wavelength", [400e-9, 700e-9])
def test_the_ray_engine_agrees(wavelength: float) -> None:
    """Rays marched through the scene's volume to 86 km: refraction and the integral within 0.01″."""
    scene = standard(wavelength, eye=2.0)
    table = refraction_table(scene, [0.0, 0.2, 1.0, 5.0, 30.0])
    air = scene.air_at()
    select_variant("auto")
    through = medium(scene, air, precision="double")
    types = through.types
    elevation = np.radians(table.elevation)
    ahead = types.Array3f(*np.stack([np.cos(elevation), np.zeros_like(elevation), np.sin(elevation)]))
    z = float(scene.earth.conformal_height(2.0))  # type: ignore[union-attr]
    # The last step ends beyond the top by 1e-5 of its length: it has to be short.
    end = trace.march(through, types.Array3f(0, 0, z), ahead, accuracy=1e-14, max_steps=100_000)
    assert np.all(np.asarray(end.status) == trace.ESCAPED)
    direction, place = np.asarray(end.direction), np.asarray(end.position)
    true = np.arctan2(direction[2], direction[0]) - place[0] / 6371e3
    marched = elevation - true
    bent_last = refraction_at_the_top(scene, direction)
    np.testing.assert_allclose(marched + bent_last, table.refraction[:, 0], rtol=0, atol=0.01 * SECOND)
    assert np.all(table.refraction[:3, 0] > 1000 * SECOND)


def refraction_at_the_top(scene: Scene, direction: FloatArray) -> FloatArray:
    """What the rest of the air above 86 km adds: (n − 1) cot of the elevation there, 0.002″."""
    left = float(FarAir.of(scene).profile.refractivity(86e3, scene.air))
    return np.asarray(left * direction[0] / direction[2])


# ---- A. T. Young's sunset over warm water (Optics & Photonics News 10 (3), 1999, 31), eye at 9.28 m, 0.7 µm

YOUNG_ARCMIN = np.array([-5.4, -5.2, -5, -4, -3, -2, -1, 0, 1, 5, 10, 20, 30])
YOUNG_LIFTED = np.array(
    [
        29.572958523228195,
        29.923551085634156,
        30.295995753454093,
        31.24432761615823,
        31.779086839581442,
        31.90645159400823,
        32.1001662379189,
        32.025068324829164,
        31.935047760750738,
        31.448737268271273,
        30.686591444739342,
        29.061017626741027,
        27.494684869109197,
    ]
)
GAS = 8.314462618 / 0.028964  # J/(kg K), of the program that the numbers come from
OURS = 287.053


def young() -> Scene:
    """Its n − 1 at the ground is that of the other program, whose gas constant is a little larger."""
    constant = 2.871e-4 * (1 + 5.67e-3 / 0.7**2) / 1.29223 * OURS / GAS
    return Scene.from_toml(
        f"""
[earth]
radius = 6378140.0
[profile]
kind = "table"
heights = [0.0, 0.8, 1.8, 2.7, 4.0, 5.9, 8.9, 18.1, 32.5, 50.0, 11000.0]
temperatures = [288.0, 287.5, 287.3, 287.2, 287.1, 287.0, 286.9, 286.7, 286.5, 286.3, 216.0]
smoothing = 0.0
beyond = "isothermal"
[air]
wavelength = 700e-9
model = "gladstone-dale"
gladstone_dale_constant = {constant!r}
[camera]
eye = [0.0, 0.0, 9.28]
"""
    )


def test_sunset_over_warm_water() -> None:
    """The other program has the same gravity at all heights; real gravity falls, and the air thins out less.

    With its gravity the numbers are its own to 0.001′; with ours refraction is 0.05 % less everywhere.
    """
    scene = young()
    far, length = FarAir.of(scene), np.array([700e-9])
    level = 9.80665 * OURS / GAS
    profile = replace(far.profile, gravity=lambda height: np.full(np.shape(height), level))
    index = SceneIndex(profile.index(scene.air, length), length, 6378140.0, 0.0, 86e3)
    lifted = trace.astronomical_refraction(
        index, YOUNG_ARCMIN * MINUTE, **index.limits(), observer_height=9.28, into_vacuum=True
    )
    np.testing.assert_allclose(lifted[:, 0] / MINUTE, YOUNG_LIFTED, rtol=0, atol=1e-3)

    table = refraction_table(scene, YOUNG_ARCMIN / 60)
    less = 1 - table.refraction[:, 0] / MINUTE / YOUNG_LIFTED
    assert np.all((less > 4e-4) & (less < 6e-4))


# ---- the superior mirage


def cold_sea(jump: float) -> Scene:
    """Air that is warmer above 30 m, by a step that is 5 m thick."""
    layers = f'layers = [{{ kind = "inversion", jump = {jump}, height = 30.0, thickness = 5.0 }}]'
    return standard(550e-9, eye=12.0, more=layers)


def test_an_inversion_shows_three_images() -> None:
    """Between the heights of the folds three images, elsewhere one: an odd number, as always in open air."""
    curve = transfer_curve(cold_sea(8.0), 20e3)
    assert [fold.kind for fold in curve.folds] == ["highest", "lowest"]
    top, bottom = (fold.height for fold in curve.folds)
    assert bottom < top
    assert [band.erect for band in curve.bands] == [True, False, True]
    between = np.linspace(bottom, top, 22)[1:-1]
    assert np.all(curve.count(between) == 3)
    visible = min(band.low_height for band in curve.bands)
    if visible < bottom:
        assert np.all(curve.count(np.linspace(visible, bottom, 22)[1:-1]) == 1)
    assert np.all(curve.count(np.linspace(top, 1.5 * top, 22)[1:]) == 1)
    assert set(curve.images[np.isfinite(curve.height)].tolist()) == {1, 3}
    inverted = curve.magnification[curve.slope < 0]
    assert inverted.size > 5
    assert np.all(inverted < 0)


def test_without_an_inversion_there_is_one_image() -> None:
    curve = transfer_curve(cold_sea(0.0), 20e3)
    assert curve.folds == ()
    assert set(curve.images[np.isfinite(curve.height)].tolist()) == {1}
    assert np.all(curve.slope[np.isfinite(curve.slope)] > 0)


def test_heights_over_a_round_earth() -> None:
    """A ray and the horizon: the ray that grazes the sea comes to the distance of the horizon at height 0.

    And by Bouguer's invariant the height at which a level ray of the eye's stands at the angle φ follows from
    ∫ dθ/(r F'), which the horizon's table integrates.
    """
    scene = standard(550e-9, eye=100.0)
    seen = horizon_table(scene, [100.0])
    grazing = -math.degrees(float(seen.dip[0]))
    curve = transfer_curve(scene, float(seen.distance[0]), [grazing + 1e-7, grazing + 0.01])
    assert abs(curve.height[0]) < 1e-3
    # the way on from there is that of an eye at 0 that looks level: it climbs to 10 m at its own horizon
    beyond = horizon_table(scene, [10.0])
    farther = transfer_curve(scene, float(seen.distance[0] + beyond.distance[0]), [grazing + 1e-7])
    assert farther.height[0] == pytest.approx(10.0, rel=0, abs=2e-3)


def test_straight_light_over_a_round_earth() -> None:
    """Without air the heights are those of a line over a sphere."""
    scene = standard(550e-9, eye=100.0).with_changes({"tracer.method": "straight"})
    curve = transfer_curve(scene, 30e3, [-0.2, 0.0, 0.3])
    np.testing.assert_allclose(curve.height, curve.straight, rtol=0, atol=1e-6)
    assert curve.magnification == pytest.approx(np.ones(3), rel=0, abs=1e-4)
    angle = 30e3 / 6371e3
    assert curve.height[1] == pytest.approx(6371100.0 / math.cos(angle) - 6371e3, rel=0, abs=1e-6)
