"""The sky: single scattering in closed form, energy that is kept, colours of day and twilight."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from nigemizu.air import refractivity, standard_atmosphere
from nigemizu.air.extinction import Coefficients, Extinction
from nigemizu.errors import InputError
from nigemizu.render import firmament as room
from nigemizu.render.firmament import Firmament, firmament
from nigemizu.render.spectrum import LUMINANCE, bands
from nigemizu.trace.columns import column_rays

FloatArray = NDArray[np.float64]

R, FLAT = 6371e3, 1e9
DEFAULT, CLEAR = Extinction(), Extinction(aerosol_depth=0.0, ozone=0.0)
NO_OZONE = Extinction(ozone=0.0)
PRIMARIES = np.array([[0.4124, 0.3576, 0.1805], LUMINANCE, [0.0193, 0.1192, 0.9505]])
BANDS = bands()


@cache
def standard(air: Extinction, some: bool = False) -> tuple[Any, Any, Coefficients]:
    """The US Standard Atmosphere 1976 with what `air` adds, in all bands or in three."""
    wavelength = BANDS.wavelength[[2, 8, 14]] if some else BANDS.wavelength
    h = np.concatenate([[0.0], np.geomspace(1.0, 86e3, 300)])
    temperature, pressure, _ = standard_atmosphere(h)
    z = R * np.log1p(h / R)
    n = 1 + np.array([refractivity(temperature, pressure, wavelength=light) for light in wavelength])
    return z, n * np.exp(z / R), air.coefficients(h, temperature, pressure, wavelength)


def sky(sun: float, air: Extinction = DEFAULT, some: bool = False, **options: Any) -> Firmament:
    given: dict[str, Any] = {"radius": R, "eye": 2.0, "sun_elevation": math.radians(sun), "air": air}
    return firmament(*standard(air, some), **(given | options))


@cache
def seen(sun: float, air: Extinction = DEFAULT) -> Firmament:
    return sky(sun, air)


def daylight(sun: float) -> float:
    """Illuminance [lx] of the ground by Sun and sky, with 133.8 klx outside the air."""
    found = seen(sun)
    light = BANDS.rgb(found.radiance) @ LUMINANCE
    around = np.trapezoid(light, found.azimuth, axis=1) * 2
    up = found.elevation
    diffuse = float(np.trapezoid(around * np.sin(up) * np.cos(up), up)) / math.pi
    direct = float(BANDS.rgb(found.sun) @ LUMINANCE) * max(math.sin(math.radians(sun)), 0.0)
    return 133.8e3 * (diffuse + direct)


def slab(depth: float, albedo: float | None = None, top: float = 8e3) -> tuple[Any, Any, Coefficients]:
    """Even air over a flat Earth; molecules, or an aerosol."""
    z = FLAT * np.log1p(np.linspace(0, top, 150) / FLAT)
    beta, none = np.full((1, 150), depth / top), np.zeros((1, 150))
    parts = (beta, none, none) if albedo is None else (none, beta, none)
    return z, np.exp(z / FLAT), Coefficients(*parts)


def chromaticity(rgb: FloatArray) -> FloatArray:
    xyz = rgb @ PRIMARIES.T
    return np.asarray(xyz[..., :2] / xyz.sum(axis=-1, keepdims=True))


@pytest.mark.parametrize("depth", [0.01, 0.5])
@pytest.mark.parametrize("sun", [70.0, 15.0])
@pytest.mark.parametrize("kind", ["molecules", "aerosol"])
def test_single_scattering_in_even_air(depth: float, sun: float, kind: str) -> None:
    """L = P E μ₀/(μ₀ − μ) (e^(−τ/μ₀) − e^(−τ/μ)) at the ground, from the formal solution of transfer."""
    air = Extinction(aerosol_albedo=0.9, aerosol_asymmetry=0.6)
    elevation, azimuth = np.radians([8.0, 30.0, 50.0, 85.0]), np.array([0.0, 0.7, 2.0, math.pi])
    found = firmament(
        *slab(depth, None if kind == "molecules" else 0.9),
        radius=FLAT,
        eye=0.0,
        sun_elevation=math.radians(sun),
        air=air,
        depolarisation=0.0,
        ground_albedo=0.0,
        multiple=False,
        elevation=elevation,
        azimuth=azimuth,
    )
    mu0, mu = math.sin(math.radians(sun)), np.sin(elevation)[:, None]
    cosine = mu0 * mu + math.cos(math.radians(sun)) * np.cos(elevation)[:, None] * np.cos(azimuth)
    phase = 3 / (16 * math.pi) * (1 + cosine**2)
    if kind == "aerosol":
        phase = 0.9 / (4 * math.pi) * (1 - 0.36) / (1.36 - 1.2 * cosine) ** 1.5
    exact = math.pi * phase * mu0 / (mu0 - mu) * (math.exp(-depth / mu0) - np.exp(-depth / mu))
    np.testing.assert_allclose(found.radiance[0], exact, rtol=1e-3)
    np.testing.assert_allclose(found.transmission[0], np.exp(-depth / mu[:, 0]), rtol=1e-3)
    assert found.sun[0] == pytest.approx(math.exp(-depth / mu0), rel=1e-3)


@pytest.mark.parametrize("depth", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("sun", [60.0, 20.0])
def test_no_light_is_lost(depth: float, sun: float) -> None:
    """Over black ground what scatters without absorbing comes down or goes back up, all of it."""
    mu, weight = np.polynomial.legendre.leggauss(16)
    mu, weight = 0.5 * (mu + 1), 0.5 * weight
    air = slab(depth)
    options: dict[str, Any] = {
        "radius": FLAT, "sun_elevation": math.radians(sun), "air": CLEAR, "ground_albedo": 0.0,
        "azimuth": (np.arange(16) + 0.5) * math.pi / 16,
    }  # fmt: skip

    def flux(**view: Any) -> float:
        return float((firmament(*air, **options, **view).radiance[0].mean(axis=-1) * 2 * mu * weight).sum())

    mu0 = math.sin(math.radians(sun))
    direct = mu0 * math.exp(-depth / mu0)
    down = flux(eye=0.0, elevation=np.arcsin(mu))
    mu, weight = mu[::-1], weight[::-1]
    up = flux(eye=float(air[0][-1]), elevation=-np.arcsin(mu))
    assert (direct + down + up) / mu0 == pytest.approx(1.0, abs=8e-3)
    once = flux(eye=float(air[0][-1]), elevation=-np.arcsin(mu), multiple=False)
    assert once < up * (1 - 0.4 * depth)  # negative control: single scattering loses much


def test_the_ground_gives_light_back() -> None:
    """The sky over bright ground is brighter, by about 1/(1 − albedo × 0.15) for molecules of depth 0.36."""
    dark, bright = (
        firmament(
            *slab(0.36), radius=FLAT, eye=0.0, sun_elevation=1.0, air=CLEAR, ground_albedo=albedo
        ).radiance
        for albedo in (0.0, 0.8)
    )
    gain = (bright / dark)[0, 20:].mean()
    assert 1.3 < gain < 2.2


def test_symmetry_and_look_up() -> None:
    found = seen(25.0)
    np.testing.assert_allclose(found.radiance[:, -1], found.radiance[:, -1, :1].repeat(48, axis=1), rtol=1e-9)
    angle = np.array([0.3, 1.0, 3.0])
    right, left = found.at(0.4, angle), found.at(0.4, -angle)
    np.testing.assert_array_equal(left, right)
    np.testing.assert_allclose(found.at(0.4, angle - 2 * math.pi), right, rtol=1e-9)
    np.testing.assert_array_equal(found.at(found.elevation[7], found.azimuth[9]), found.radiance[:, 7, 9])
    # brightest on the Sun's side, least about 90° from the Sun on its vertical
    assert found.at(0.4, 0.0)[8] > 2 * found.at(0.4, math.pi)[8]


def test_without_air_the_sky_is_black() -> None:
    z, index, given = slab(0.0)
    found = firmament(z, index, given, radius=FLAT, eye=0.0, sun_elevation=0.5, air=CLEAR)
    np.testing.assert_array_equal(found.radiance, 0.0)
    np.testing.assert_allclose(found.transmission, 1.0, rtol=1e-12)
    np.testing.assert_allclose(found.true_elevation[0, 1:], found.elevation[1:], atol=1e-6)
    assert found.sun[0] == pytest.approx(1.0, rel=1e-3)


def test_rays_are_those_of_the_columns() -> None:
    """Two ways to the same rays: compiled and cut into pieces; NumPy, whole. And the horizon's dip."""
    z, index, given = standard(DEFAULT)
    found = sky(10.0, eye=60.0, multiple=False)
    whole, rows = sum(given[1:], given[0]), found.elevation
    rays = column_rays(z, index, eye=60.0, elevation=rows, radius=R, coefficients=whole)
    np.testing.assert_allclose(found.true_elevation[:, 3:], rays.true_elevation[:, 3:], atol=3e-7)
    # all colours on the lines of sight of the middle one; on their own, depths differ by the dispersion
    middle = column_rays(z, index[8], eye=60.0, elevation=rows, radius=R, coefficients=whole)
    depth = -np.log(found.transmission)
    np.testing.assert_allclose(depth[:, 3:], middle.depth[:, 3:], rtol=2e-3)
    np.testing.assert_allclose(depth[:, 3:], rays.depth[:, 3:], rtol=6e-3)
    geometric = -math.acos(R / (R + 60.0))
    assert 0.88 < found.horizon / geometric < 0.96  # refraction lifts it by some 8 %
    # horizontal refraction some 34′, more in blue
    lift = np.degrees(found.elevation[1] - found.true_elevation[:, 1]) * 60
    assert 33 < lift[8] < 40
    assert lift[0] > lift[-1] + 0.3


def test_rays_below_the_horizon() -> None:
    found = sky(30.0, eye=100.0, some=True, elevation=np.array([-0.2, -0.05, 0.01, 0.5]))
    np.testing.assert_array_equal(found.transmission[:, :2], 0.0)
    assert np.isnan(found.true_elevation[:, :2]).all()
    assert np.isfinite(found.true_elevation[:, 2:]).all()
    near, far = found.radiance[:, 0], found.radiance[:, 1]
    assert np.all(far > 2 * near)  # more air before the ground
    assert np.all(near > 0)


def test_sunset_of_the_direct_sun() -> None:
    """Refraction keeps the Sun up to −0.57° − 0.27° of its middle; it reddens, and goes down slowly."""
    few: dict[str, Any] = {"elevation": [0.1, 0.2], "azimuth": [0.0, 1.0], "multiple": False}
    left = np.array([sky(s, eye=0.0, some=True, **few).sun for s in (0.2, -0.3, -0.55, -0.8, -1.1)])
    red = left[:, -1]
    assert np.all(np.diff(red) < 0)
    assert red[3] > 0.0
    np.testing.assert_array_equal(left[4], 0.0)
    assert left[1, 0] / left[1, -1] < 1e-2
    # At 0.62° apparent √(πX/2) erfcx(√(X/2) sin e) air masses, X = R/H: 28 of molecules (8 km, τ = 0.042),
    # 51 of aerosol (1.2 km, 0.061), some 13 of ozone (0.010): e^−4.4, times 0.85, the Sun's flattening, is
    # 0.010. Near the ground rays are bent, and paths longer by 5 %: 0.0085.
    assert 0.0070 < red[0] < 0.0100
    # high up: e^(−τ/sin) over a flat Earth
    _, _, given = standard(DEFAULT, True)
    h = np.concatenate([[0.0], np.geomspace(1.0, 86e3, 300)])
    depth = sum(np.trapezoid(part, h) for part in given)
    high = sky(60.0, eye=0.0, some=True, **few).sun
    np.testing.assert_allclose(high, np.exp(-depth / math.sin(math.pi / 3)), rtol=2e-3)


def test_blue_sky() -> None:
    """Zenith of clear skies, x = 0.24 to 0.27 and y = 0.24 to 0.28; 0.5 to 6 kcd/m² of 42.6 kcd/m² per unit.

    J. Hernández-Andrés, J. Romero, R. L. Lee, J. Opt. Soc. Am. A 18 (2001) 1325, doi:10.1364/JOSAA.18.001325
    (skylight near the locus of daylight).
    """
    found = seen(35.0)
    zenith = BANDS.rgb(found.radiance[:, -1, 0])
    x, y = chromaticity(zenith)
    assert 0.24 < x < 0.27
    assert 0.24 < y < 0.28
    assert 500 < zenith @ LUMINANCE * 42.6e3 < 6000
    horizon = BANDS.rgb(found.at(math.radians(2.0), 2.0))
    assert horizon @ LUMINANCE > 2 * zenith @ LUMINANCE
    assert chromaticity(horizon)[0] > x + 0.02  # whiter


def zenith(depth: float, mu0: float, layers: int = 120) -> tuple[float, float]:
    """Zenith of even air over black ground, all orders of scattering by molecules one after the other.

    Returns π L/E, and the flux that comes down or goes back up over that which enters. Only the mean over
    azimuth of the phase function is seen at the zenith: 3/8 ((3 − b²) + (3b² − 1) a²) for the sines a and b
    of both elevations.
    """
    mu, weight = np.polynomial.legendre.leggauss(24)
    mu, weight = 0.5 * (mu + 1), 0.5 * weight
    a = np.append(mu, 1.0)
    beam = np.exp(-np.linspace(0, depth, layers + 1) / mu0) * 3 / (32 * math.pi)
    first = np.stack([beam * (3 - mu0**2), beam * (3 * mu0**2 - 1)])
    even = first
    step = depth / layers / a
    left = np.exp(-step)
    near = (1 - left) / step  # weights of a source that is linear between the nodes
    for _ in range(25):
        source = even[0][:, None] + even[1][:, None] * a**2
        down, up = np.zeros_like(source), np.zeros_like(source)
        for i in range(layers):
            down[i + 1] = down[i] * left + source[i] * (near - left) + source[i + 1] * (1 - near)
        for i in range(layers)[::-1]:
            up[i] = up[i + 1] * left + source[i + 1] * (near - left) + source[i] * (1 - near)
        light = 0.5 * (down + up)[:, :-1] * weight
        whole, upright = light.sum(axis=1), light @ mu**2
        even = first + 3 / 8 * np.stack([3 * whole - upright, 3 * upright - whole])
    leaves = 2 * math.pi * ((down[-1] + up[0])[:-1] * mu * weight).sum() + mu0 * math.exp(-depth / mu0)
    return math.pi * float(down[-1, -1]), float(leaves) / mu0


@pytest.mark.parametrize("sun", [60.0, 20.0, 10.0])
def test_scattering_of_all_orders(sun: float) -> None:
    """At 650, 450 and 350 nm or so: depths 0.047, 0.205 and 0.56, as λ⁻⁴ from 0.092 at 550 nm."""
    depths = 0.092 * (550 / np.array([[650], [450], [350]])) ** 4
    exact, energy = np.array([zenith(float(depth), math.sin(math.radians(sun))) for depth in depths[:, 0]]).T
    np.testing.assert_allclose(energy, 1.0, atol=1e-4)  # the yardstick loses no light
    z, index, air = slab(1.0)
    beta = depths * air.rayleigh
    options: dict[str, Any] = {
        "radius": FLAT, "eye": 0.0, "sun_elevation": math.radians(sun), "air": CLEAR, "ground_albedo": 0.0,
        "depolarisation": 0.0, "elevation": [1.5, math.pi / 2], "azimuth": [0.0, 1.0],
    }  # fmt: skip
    found, once = (
        firmament(z, index, Coefficients(beta, 0 * beta, 0 * beta), **options, multiple=often).radiance[
            :, -1, 0
        ]
        for often in (True, False)
    )
    ratio = found / exact
    assert np.all((ratio > 0.98) & (ratio < 1.05)), ratio  # what even second scattering costs
    assert np.all(once < exact * 0.96)  # negative control
    if sun == 60.0:
        assert found[1] / found[0] == pytest.approx(exact[1] / exact[0], rel=0.02)
        assert 3.9 < found[1] / found[0] < (650 / 450) ** 4  # less blue than thin air


def test_noon_zenith_is_as_bright_as_published() -> None:
    """Within a factor of 1.5 of the zenith that A. J. Preetham, P. Shirley and B. Smits fitted (1999).

    doi:10.1145/311535.311545, appendix: T is the depth of molecules and aerosol over that of molecules. For a
    low Sun the fit tends to 2 kcd/m², more than twice what molecules scatter, and is no yardstick.
    """
    h = np.concatenate([[0.0], np.geomspace(1.0, 86e3, 300)])
    for air in (DEFAULT, Extinction(aerosol_depth=0.03)):
        given = standard(air)[2]
        middle = int(np.argmin(np.abs(BANDS.wavelength - 550e-9)))
        molecules, aerosol = (float(np.trapezoid(part[middle], h)) for part in given[:2])
        turbidity = 1 + aerosol / molecules
        chi = (4 / 9 - turbidity / 120) * (math.pi - math.radians(60.0))
        fitted = (4.0453 * turbidity - 4.9710) * math.tan(chi) - 0.2155 * turbidity + 2.4192
        light = BANDS.rgb(sky(60.0, air, elevation=[1.5, math.pi / 2]).radiance[:, -1, 0]) @ LUMINANCE
        assert 1 / 1.5 < 133.8 / math.pi * light / fitted < 1.5


def test_sunset_is_red_and_twilight_blue() -> None:
    low = BANDS.rgb(seen(0.0).at(math.radians(1.0), 0.0))
    assert chromaticity(low)[0] > 0.42
    assert low[0] > 2 * low[2]
    x = chromaticity(BANDS.rgb(seen(-4.0).radiance[:, -1, 0]))[0]
    without = chromaticity(BANDS.rgb(seen(-4.0, NO_OZONE).radiance[:, -1, 0]))[0]
    assert x < 0.275
    assert without > x + 0.03  # E. O. Hulburt 1953, doi:10.1364/JOSA.43.000113: ozone makes twilight blue
    # in daylight it hardly matters
    day = [chromaticity(BANDS.rgb(seen(50.0, air).radiance[:, -1, 0]))[0] for air in (DEFAULT, NO_OZONE)]
    assert abs(day[0] - day[1]) < 0.01


@pytest.mark.parametrize(("sun", "low", "high"), [(-5 / 6, 410.0, 585.0), (-6.0, 2.0, 3.5)])
def test_twilight_is_as_bright_as_it_is(sun: float, low: float, high: float) -> None:
    """Illuminance [lx] at the beginning and the end of a clear evening's civil twilight.

    American Meteorological Society, Glossary of Meteorology, "civil twilight".
    """
    assert low < daylight(sun) < high


def test_the_shadow_of_the_earth() -> None:
    """Opposite to the Sun it is dark below, and lit in pink above (the belt of Venus)."""
    found = seen(-3.0)
    shadow, belt = (BANDS.rgb(found.at(math.radians(e), math.pi)) for e in (1.0, 9.0))
    assert belt @ LUMINANCE > 1.1 * shadow @ LUMINANCE
    assert belt[0] / belt[2] > 1.1 * shadow[0] / shadow[2]


@pytest.mark.parametrize("sun", [30.0, 1.0, -4.0])
def test_finer_tables_change_little(sun: float, monkeypatch: pytest.MonkeyPatch) -> None:
    options: dict[str, Any] = {
        "elevation": np.array([1e-3, 0.02, 0.3, 1.5]),
        "azimuth": np.array([0.0, 1.0, 3.0]),
    }
    plain = sky(sun, **options).radiance
    for name, value in (
        ("_PIECES", 500), ("_SUN_HEIGHTS", 90), ("_SUN_ELEVATIONS", 320), ("_SUN_RAYS", 400),
        ("_OFTEN_HEIGHTS", 40), ("_OFTEN_ELEVATIONS", 110), ("_OFTEN_STEPS", 48),
    ):  # fmt: skip
        monkeypatch.setattr(room, name, value)
    fine = sky(sun, **options).radiance
    np.testing.assert_allclose(fine, plain, rtol=0.03)
    np.testing.assert_allclose(fine[:, 2:], plain[:, 2:], rtol=0.01)


@pytest.mark.parametrize(
    "change",
    [
        {"sun_elevation": math.radians(-12.0)},
        {"sun_elevation": 60.0},
        {"ground_albedo": 1.5},
        {"radius": math.inf},
        {"eye": -5.0},
        {"eye": 1e6},
        {"elevation": [0.3, 0.2]},
        {"elevation": [0.0, 90.0]},
        {"azimuth": [-1.0, 1.0]},
    ],
)
def test_what_is_refused(change: dict[str, Any]) -> None:
    good: dict[str, Any] = {"radius": FLAT, "eye": 0.0, "sun_elevation": 0.5, "air": CLEAR}
    with pytest.raises(InputError):
        firmament(*slab(0.1), **(good | change))
    z, index, _ = slab(0.1)
    with pytest.raises(InputError):
        firmament(z, index, Coefficients(*np.full((3, 1, 150), -1.0)), **good)
