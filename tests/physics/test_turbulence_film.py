"""A film through turbulence of known strength, rendered and measured: from the air to the number.

Everything lies between the two: the field, the index, bent rays from all over the aperture, the panel's
picture, its tiles followed through the film. The theory is integrated here, in wave numbers along the axes of
the picture, with what the film holds: scales, the cone of light from a near panel, square tiles, an index
that is linear between cells across the path.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.special import gamma, j1

from nigemizu.measure import Film, Measurement, measure_film
from nigemizu.progress import SILENT
from nigemizu.scene import Scene
from nigemizu.scene.rendering import Studio
from nigemizu.scene.running import air_instants

SCENE = Path(__file__).resolve().parents[2] / "docs" / "data" / "arrival" / "scene.toml"
CN2, LENGTH, OUTER, INNER = 1e-14, 200.0, 4.0, 0.01
CELL = 0.008  # m
APERTURES = (0.04, 0.125)
FRAMES = 40
SMALL = {"film.frames": FRAMES, "film.duration": FRAMES, "time.duration": FRAMES, "camera.width": 288,
         "camera.samples": 8, "turbulence.seed": 7}  # fmt: skip


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


@pytest.fixture(scope="module")
def measured() -> dict[float, Measurement]:
    """The same air seen through both apertures."""
    lenses = {d: Scene.load(SCENE, {**SMALL, "camera.f_number": 1.0 / d}) for d in APERTURES}
    assert lenses[0.04].turbulence is not None
    assert (lenses[0.04].turbulence.cn2, lenses[0.04].turbulence.outer_scale) == (CN2, OUTER)
    studios = {d: Studio(lens, "auto") for d, lens in lenses.items()}
    frames: dict[float, list[np.ndarray]] = {d: [] for d in APERTURES}
    times = tuple(float(number) for number in range(FRAMES))
    for number, air in enumerate(air_instants(lenses[0.04], times, None, SILENT)):
        for d, studio in studios.items():
            frames[d].append(np.asarray(studio.shoot(air, frame=number).pixels))
    return {
        d: measure_film(
            Film.from_frames(frames[d], interval=1.0), distance=LENGTH, aperture=d, inner_scale=INNER,
            outer_scale=OUTER, pixel_angle=lens.camera.pixel_angle, cn2=CN2,
        )
        for d, lens in lenses.items()
    }  # fmt: skip


def test_the_angle_of_arrival_through_two_apertures(measured: dict[float, Measurement]) -> None:
    """Expected: the theory within the 95 % interval, and theory of other strengths outside.

    With 40 frames the interval reaches some 20 % to either side: half the strength and twice the strength are
    excluded, and so is the strength that a star's plane wave would take.
    """
    for d, one in measured.items():
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


def test_a_larger_aperture_sees_less(measured: dict[float, Measurement]) -> None:
    """Expected: the ratio of the variances, better known than either, as both lenses look through one air.

    Bound: three standard deviations of the logarithm of the ratio of two variances, 2 sqrt((1 − ρ²)/n) for
    Gaussian numbers of the correlation ρ; n is that of frames and axes, tiles not counted. An aperture that
    did not count, or a variance that went as D^(−1), would fall outside.
    """
    small, large = APERTURES
    pixel = measured[small].optics.pixel_angle
    own = [covariance(d, d, pixel) for d in APERTURES]
    theory = own[1] / own[0]
    resemblance = covariance(small, large, pixel) / math.sqrt(own[0] * own[1])
    bound = 3 * 2 * math.sqrt((1 - resemblance**2) / (2 * FRAMES))
    found = measured[large]["variance"].value / measured[small]["variance"].value
    assert theory == pytest.approx((large / small) ** (-1 / 3), rel=0.15)
    assert abs(math.log(found / theory)) < bound
    for wrong in (1.0, small / large):
        assert abs(math.log(found / wrong)) > bound
