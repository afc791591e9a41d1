"""Closed forms behind a measured film, against published constants and against another implementation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nigemizu.errors import InputError
from nigemizu.heat.turbulence.theory import SEEING, angle_of_arrival_variance, differential_angle_variance
from nigemizu.measure import TILT, Optics, coherence_length, difference_forms, unit_variance

CN2 = 1e-13
# 1 km, 550 nm, 50 mm: r0 = (0.42336327 k² share ∫Cn²)^(−3/5), share 1 or 3/8, and the gradient tilt
EXACT = {
    "plane": (0.005683180859686037, 7.702973053963145e-10),
    "spherical": (0.010237000310828082, 2.8886148952361794e-10),
}


def optics(**changes):
    return Optics(**{"distance": 1000.0, "aperture": 0.05, "pixel_angle": 1e-5, **changes})


@pytest.mark.parametrize("wave", ["plane", "spherical"])
def test_published_numbers(wave):
    r0, variance = EXACT[wave]
    o = optics(wave=wave)
    assert float(coherence_length(CN2, o)) == pytest.approx(r0, rel=1e-7)
    # published with constants rounded at the fourth digit; not the 0.182 of the Zernike tilt
    assert CN2 * unit_variance(o) / variance == pytest.approx(1.0, abs=2e-4)
    by_r0 = TILT * (o.wavelength / o.aperture) ** 2 * (o.aperture / r0) ** (5 / 3)
    assert by_r0 / (CN2 * unit_variance(o)) == pytest.approx(1.0, rel=1e-9)
    assert pytest.approx(6.883877182293811, rel=1e-12) == SEEING
    assert pytest.approx(0.170, abs=5e-4) == TILT


@pytest.mark.parametrize("wave", ["plane", "spherical"])
@pytest.mark.parametrize(
    "scales", [{}, {"outer_scale": 2.0}, {"inner_scale": 0.008, "outer_scale": 5.0}, {"largest": 0.5}]
)
def test_quadrature_agrees_with_the_other_implementation(wave, scales):
    other = angle_of_arrival_variance(CN2, 1000.0, 0.05, wave=wave, **scales)
    # a patch of no size goes through the quadrature where a point would take the closed form
    assert CN2 * unit_variance(optics(wave=wave, **scales), 1e-13) / other == pytest.approx(1.0, rel=2e-3)


def test_differences_agree_with_the_other_implementation():
    o = optics(outer_scale=2.0)
    for apart in (0.02, 0.2, 1.0):
        isotropic, directional = difference_forms(o, 0.0, [apart / 1000.0])
        for axis, sign in (("along", 1.0), ("across", -1.0)):
            other = differential_angle_variance(CN2, 1000.0, 0.05, apart, axis=axis, outer_scale=2.0)
            assert CN2 * (isotropic + sign * directional)[0] / other == pytest.approx(1.0, rel=5e-3)


@pytest.mark.parametrize(("wave", "share"), [("plane", 1.0), ("spherical", 1 / 3)])
def test_pinhole_sees_down_to_the_inner_scale(wave, share):
    inner = 0.005
    o = optics(aperture=0.0, inner_scale=inner, wave=wave)
    # π² A Γ(1/6) km^(1/3) with A = 0.033005 and km = 5.9091/l0
    exact = math.pi**2 * 0.0330053901 * math.gamma(1 / 6) * (5.9091 / inner) ** (1 / 3) * 1000.0 * share
    assert unit_variance(o) == pytest.approx(exact, rel=1e-4)
    assert unit_variance(o, 1e-13) == pytest.approx(exact, rel=2e-3)
    half = unit_variance(optics(aperture=0.0, inner_scale=inner / 2, wave=wave))
    assert half / unit_variance(o) == pytest.approx(2 ** (1 / 3), rel=1e-9)


def test_a_patch_averages():
    o = optics(outer_scale=3.0)
    radii = [0.0, 1e-5, 1e-4, 1e-3]
    values = [unit_variance(o, radius) for radius in radii]
    assert values == sorted(values, reverse=True)
    assert values[1] == pytest.approx(values[0], rel=0.03)
    assert values[3] < 0.5 * values[0]
    isotropic, _ = difference_forms(o, 1e-4, [0.05])
    # far beyond the outer scale two tiles know nothing of each other, but for the last part of the path
    assert isotropic[0] == pytest.approx(2 * values[2], rel=0.1)
    assert isotropic[0] < 2 * values[2]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"distance": -1.0}, ["--distance", "-1.0"]),
        ({"pixel_angle": 0.0}, ["--pixel-angle"]),
        ({"aperture": -0.1}, ["--aperture"]),
        ({"aperture": 0.0}, ["--inner-scale", "pinhole"]),
        ({"cn2": math.nan}, ["--cn2"]),
        ({"wave": "square"}, ["--wave", "'square'"]),
    ],
)
def test_impossible_optics(changes, words):
    with pytest.raises(InputError) as raised:
        optics(**changes)
    assert all(word in str(raised.value) for word in words)


def test_no_turbulence_has_no_end_of_coherence():
    assert np.isinf(coherence_length([0.0, -1e-15], optics())).all()
