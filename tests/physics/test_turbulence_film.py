"""A film through turbulence of known strength, rendered and measured: from the air to the number.

Everything lies between the two: the field, the index, bent rays from all over the aperture, the panel's
picture, its tiles followed through the film. The theory is integrated here, in wave numbers along the axes of
the picture, with what the film holds: scales, the cone of light from a near panel, square tiles, an index
that is linear between cells across the path. (That the mean of a level does not fluctuate takes off another
3 to 4 %, which so few frames do not show.) Straight rays through the very same air, summed here with SciPy,
leave chance out and do show a few per cent.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates
from scipy.special import gamma, j1

from nigemizu.measure import Film, Measurement, measure_film
from nigemizu.progress import SILENT
from nigemizu.scene import Scene
from nigemizu.scene.rendering import Studio
from nigemizu.scene.running import AirVolume, air_instants

SCENE = Path(__file__).resolve().parents[2] / "docs" / "data" / "arrival" / "scene.toml"
CN2, LENGTH, OUTER, INNER = 1e-14, 200.0, 4.0, 0.01
CELL = 0.008  # m
APERTURES = (0.04, 0.125)
FRAMES, TILES = 32, 16
SMALL = {"film.frames": FRAMES, "film.duration": FRAMES, "time.duration": FRAMES, "camera.width": 288,
         "camera.samples": 4, "turbulence.seed": 7}  # fmt: skip


def wave_numbers(pieces: int = 30) -> tuple[np.ndarray, np.ndarray]:
    """Positive wave numbers along one axis and their weights: even steps of asinh(κ / κ0)."""
    k0 = 2 * math.pi / OUTER
    nodes, weights = np.polynomial.legendre.leggauss(6)
    ends = np.linspace(0, math.asinh(4 * 5.91 / INNER / k0), pieces + 1)
    u = ((ends[1:] + ends[:-1])[:, None] / 2 + np.diff(ends)[:, None] / 2 * nodes).ravel()
    step = (np.diff(ends)[:, None] / 2 * weights).ravel()
    return k0 * np.sinh(u), step * k0 * np.cosh(u)


def covariance(one: float, other: float, pixel: float) -> float:
    """Covariance [rad²] of the angles that two apertures measure, mean of both axes; for one, its variance.

    2π Cn² ∫dz w² ∫∫ ½κ² Φ F(κ w D1/2) F(κ w D2/2) (tile)² (cells)² dκ_x dκ_y, F(x) = 2 J1(x)/x.
    """
    kx, step = wave_numbers()
    ky = kx[:, None]
    k = np.hypot(kx, ky)
    constant = float(gamma(8 / 3)) * math.sin(math.pi / 3) / (4 * math.pi**2)
    spectrum = (
        constant * (k**2 + (2 * math.pi / OUTER) ** 2) ** (-11 / 6) * np.exp(-((k * INNER / 5.91) ** 2))
    )
    cells = np.sinc(kx * CELL / (2 * math.pi)) ** 4 * (kx < math.pi / CELL)
    density = 0.5 * k**2 * spectrum * cells * step * step[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(24)
    total = 0.0
    for v, weight in zip((nodes + 1) / 2, weights, strict=True):
        w, z = v * v, (1 - v * v) * LENGTH
        discs = [2 * j1(x) / x for x in (w * k * one / 2, w * k * other / 2)]
        side = 16 * pixel * z / (2 * math.pi)
        tile = (np.sinc(kx * side) * np.sinc(ky * side)) ** 2 * np.exp(-((k * pixel * z) ** 2))
        total += weight * v * w * w * float(np.sum(density * discs[0] * discs[1] * tile))
    # four quadrants
    return 2 * math.pi * CN2 * LENGTH * 4 * total


def straight_angles(air: AirVolume, aperture: float, pixel: float, tiles: int) -> np.ndarray:
    """Angles of arrival of a row of tiles (tiles, 2) [rad] by straight rays, to the left and up."""
    x, y, z, index = air[:4]
    middles = -16 * pixel * (np.arange(tiles) - (tiles - 1) / 2)
    left = np.add.outer(middles, 4 * pixel * np.array([-1, 1, -1, 1]))[..., None]
    up = np.broadcast_to(4 * pixel * np.array([-1, -1, 1, 1])[:, None], left.shape)
    number = np.arange(48)
    radius, turn = np.sqrt((number + 0.5) / 48) * aperture / 2, 2.39996323 * number
    near, seen = np.abs(y) < 0.5, np.flatnonzero((x > 0) & (x < LENGTH))
    fine = np.linspace(z[0], z[-1], 2 * z.size - 1)
    values, step = CubicSpline(z, index[:, near][:, :, seen], axis=0)(fine), fine[1] - fine[0]
    distance = x[seen][:, None, None, None]
    w = 1 - distance / LENGTH
    columns = (distance * left + w * radius * np.cos(turn) - y[near][0]) / CELL
    rows = (0.2 + distance * up + w * radius * np.sin(turn) - fine[0]) / step
    planes = np.broadcast_to(np.arange(seen.size)[:, None, None, None], rows.shape)
    # differences between neighbours stand half-way between them
    across = map_coordinates(np.diff(values, axis=1) / CELL, [rows, columns - 0.5, planes], order=1)
    upwards = map_coordinates(np.diff(values, axis=0) / step, [rows - 0.5, columns, planes], order=1)
    slopes = np.stack([across, upwards], axis=-1).mean(axis=(2, 3))
    return np.asarray((x[1] - x[0]) * np.einsum("xtsp,xta->ta", w, slopes))


@pytest.fixture(scope="module")
def films() -> dict[float, tuple[Measurement, float]]:
    """The same air through both apertures: what is measured, and the variance of straight rays [rad²]."""
    lenses = {d: Scene.load(SCENE, {**SMALL, "camera.f_number": 1.0 / d}) for d in APERTURES}
    assert lenses[0.04].turbulence is not None
    assert (lenses[0.04].turbulence.cn2, lenses[0.04].turbulence.outer_scale) == (CN2, OUTER)
    studios = {d: Studio(lens, "auto") for d, lens in lenses.items()}
    pixel = lenses[0.04].camera.pixel_angle
    frames: dict[float, list[np.ndarray]] = {d: [] for d in APERTURES}
    angles: dict[float, list[np.ndarray]] = {d: [] for d in APERTURES}
    times = tuple(float(number) for number in range(FRAMES))
    for number, air in enumerate(air_instants(lenses[0.04], times, None, SILENT)):
        for d, studio in studios.items():
            frames[d].append(np.asarray(studio.shoot(air, frame=number).pixels))
            angles[d].append(straight_angles(air, d, pixel, TILES))
    found = {}
    for d in APERTURES:
        film = Film.from_frames(frames[d], interval=1.0)
        optics = {"distance": LENGTH, "aperture": d, "inner_scale": INNER, "outer_scale": OUTER, "cn2": CN2}
        measured = measure_film(film, pixel_angle=pixel, **optics)
        assert np.isfinite(measured.tiles.radius).sum() == TILES
        found[d] = measured, float(np.var(angles[d], axis=0, ddof=1).mean())
    return found


def test_a_film_shows_what_straight_rays_say(films: dict[float, tuple[Measurement, float]]) -> None:
    """Expected: the variance of the angles of straight rays through the same air, within 5 %.

    Tiles count as four directions and the aperture as 48 points; the index is linear between cells where the
    renderer's is smooth in height.
    """
    for measured, straight in films.values():
        assert measured["variance"].value / straight == pytest.approx(1.0, abs=0.05)


def test_the_angle_of_arrival_through_two_apertures(films: dict[float, tuple[Measurement, float]]) -> None:
    """Expected: the theory within the 95 % interval, and theory of other strengths outside.

    With 32 frames the interval reaches some 20 % to either side: half the strength and twice the strength are
    excluded, and so is the strength that a star's plane wave would take.
    """
    for d, (one, _) in films.items():
        found, theory = one["variance"], covariance(d, d, one.optics.pixel_angle)
        assert one.independent > 0.8 * FRAMES
        assert one.noise_share < 0.02
        assert found.low <= theory <= found.high
        assert found.high / found.low < 1.9
        for wrong in (0.5, 2.0, 8 / 3):
            assert not found.low <= wrong * theory <= found.high
        # what the program holds beside it knows nothing of cells, 3 % at most
        assert found.theory is not None
        assert found.theory / theory == pytest.approx(1.0, abs=0.03)
        assert one["cn2"].agrees
        assert one["difference"].value < 2 * found.value


def test_a_larger_aperture_sees_less(films: dict[float, tuple[Measurement, float]]) -> None:
    """Expected: the ratio of the variances, better known than either, as both lenses look through one air.

    Bound: three standard deviations of the logarithm of the ratio of two variances, 2 sqrt((1 − ρ²)/n) for
    Gaussian numbers of the correlation ρ; n is that of frames and axes, tiles not counted. An aperture that
    did not count, or a variance that went as D^(−1), would fall outside.
    """
    small, large = APERTURES
    pixel = films[small][0].optics.pixel_angle
    own = [covariance(d, d, pixel) for d in APERTURES]
    theory = own[1] / own[0]
    resemblance = covariance(small, large, pixel) / math.sqrt(own[0] * own[1])
    bound = 3 * 2 * math.sqrt((1 - resemblance**2) / (2 * FRAMES))
    found = films[large][0]["variance"].value / films[small][0]["variance"].value
    assert theory == pytest.approx((large / small) ** (-1 / 3), rel=0.15)
    assert abs(math.log(found / theory)) < bound
    for wrong in (1.0, small / large):
        assert abs(math.log(found / wrong)) > bound
