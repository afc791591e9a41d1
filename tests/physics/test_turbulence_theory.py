"""Closed forms of light in turbulence against numbers computed elsewhere.

The numbers are those of Kolmogorov's theory (Tatarskii 1971, Fried 1966, Noll 1976), computed with mpmath
from the Gamma forms of that theory; the literature prints them rounded: 6.88, 0.033, 2.91, 0.423, 2.25, 1.23,
0.497.
"""

import math

import numpy as np
import pytest
from scipy.special import gamma, j1, kv

from nigemizu.errors import InputError
from nigemizu.heat.turbulence import (
    angle_of_arrival_variance,
    aperture_scintillation,
    cn2_from_ct2,
    ct2_from_cn2,
    differential_angle_variance,
    fried_parameter,
    rytov_variance,
    structure_function,
    temperature_spectrum,
)
from nigemizu.heat.turbulence.spectrum import INERTIAL, INNER
from nigemizu.heat.turbulence.theory import FRIED, PHASE_STRUCTURE, RYTOV_LAYER, SEEING

STRONG = (1e-13, 1000.0, 0.05)  # Cn2, length of the path, diameter of the aperture; 550 nm


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (SEEING, 6.883877182293811),
        (INERTIAL, 0.03300539063636137),
        (PHASE_STRUCTURE, 2.914380777465098),
        (FRIED, 0.42336327338338453),
        (RYTOV_LAYER, 2.2526304391340766),
        (INERTIAL * SEEING * 2 * math.pi / PHASE_STRUCTURE * (2 * math.pi) ** (-5 / 3), 0.02289558710855518),
        (rytov_variance(1.0, 1.0, 2 * math.pi, wave="plane"), 1.228707512254951),
        (rytov_variance(1.0, 1.0, 2 * math.pi, wave="spherical"), 0.4967853302339312),
        (fried_parameter(*STRONG[:2]), 0.005683180859686037),
        (fried_parameter(*STRONG[:2], wave="spherical"), 0.010237000310828082),
        (rytov_variance(*STRONG[:2]), 6.66144667248312),
        (rytov_variance(*STRONG[:2], wave="spherical"), 2.693325264164726),
        (angle_of_arrival_variance(*STRONG, tilt="zernike"), 8.253517776731133e-10),
    ],
)
def test_constants_and_a_strong_path(value, expected):
    assert value == pytest.approx(expected, rel=1e-9, abs=0)


def test_zernike_tilt_has_the_variance_of_noll():
    # one axis of tilt: 0.44888 (D/r0)^(5/3) rad2 (Noll 1976 prints 0.448), as an angle 4 a2 / (k D)
    k, r0 = 2 * math.pi / 550e-9, fried_parameter(*STRONG[:2])
    variance = 16 * 0.44887897367364427 * (0.05 / r0) ** (5 / 3) / (k * 0.05) ** 2
    assert angle_of_arrival_variance(*STRONG, tilt="zernike") == pytest.approx(variance, rel=1e-9, abs=0)


@pytest.mark.parametrize(
    ("wave", "published"), [("plane", 7.702973053963145e-10), ("spherical", 2.8886148952361794e-10)]
)
def test_gradient_tilt(wave, published):
    value = angle_of_arrival_variance(*STRONG, wave=wave)
    # 0.16979 (λ/D)² (D/r0)^(5/3) in five digits, which is as far as the published number goes
    assert value == pytest.approx(published, rel=1.5e-4, abs=0)
    # ∫ x^(-2/3) (2 J1(x)/x)² dx by brute force: the head 3 x^(1/3), then Gauss-Legendre
    nodes, weights = np.polynomial.legendre.leggauss(8)
    ends = np.concatenate([np.geomspace(1e-9, 1.0, 400), np.arange(1.5, 5000.0, 0.5)])
    x = 0.5 * (ends[1:, None] + ends[:-1, None] + np.diff(ends)[:, None] * nodes)
    moment = 3 * 1e-9 ** (1 / 3) + np.sum(
        0.5 * np.diff(ends)[:, None] * weights * x ** (-2 / 3) * (2 * j1(x) / x) ** 2
    )
    share = 1.0 if wave == "plane" else 3 / 8
    expected = 2 * math.pi**2 * INERTIAL * 1e-13 * 1000 * share * moment * 0.025 ** (-1 / 3)
    assert value == pytest.approx(expected, rel=1e-8, abs=0)


@pytest.mark.parametrize(
    ("aperture", "expected"),
    [
        (0.0, 0.08320383108428041),
        (0.005, 0.08199767969891586),
        (0.01, 0.07975621608691882),
        (0.02, 0.07378605482130106),
        (0.05, 0.05209927723515124),
        (0.1, 0.022833466590923498),
        (0.2, 0.005608189388679994),
        (0.5, 0.0007590789320261362),
    ],
)
def test_scintillation_of_a_star_falls_with_the_aperture(aperture, expected):
    # one layer at 10 km with ∫Cn²dh = 1e-13, 550 nm; Gauss quadrature of Tatarskii's aperture filter
    assert aperture_scintillation(1e-13, 1e4, aperture) == pytest.approx(expected, rel=1e-4, abs=0)


def test_scintillation_of_a_large_aperture_tends_to_the_power_law():
    # σ² → 17.34 D^(-7/3) ∫Cn² h² dh, from below, and the closer the larger the aperture
    ratios = [
        aperture_scintillation(1e-13, 1e4, d) / (17.343613149407076 * d ** (-7 / 3) * 1e-13 * 1e8)
        for d in (1.0, 2.0, 4.0)
    ]
    assert 0.90 < ratios[0] < ratios[1] < ratios[2] < 1.0
    assert ratios[2] > 0.96


def von_karman(r, outer_scale):
    """Closed form for C_T² = 1 without inner scale (Bessel function of order 1/3)."""
    k0 = 2 * math.pi / outer_scale
    variance = 2 * math.pi * INERTIAL * gamma(1.5) * gamma(1 / 3) / gamma(11 / 6) * k0 ** (-2 / 3)
    x = k0 * r
    return 2 * variance * (1 - 2 ** (2 / 3) / gamma(1 / 3) * x ** (1 / 3) * kv(1 / 3, x))


def test_structure_function_without_and_with_an_outer_scale():
    r = np.array([1e-3, 0.01, 0.3, 1.0, 5.0])
    np.testing.assert_allclose(structure_function(r), r ** (2 / 3), rtol=1e-8)
    np.testing.assert_allclose(structure_function(r, outer_scale=2.0), von_karman(r, 2.0), rtol=1e-8)
    assert structure_function(0.0) == 0.0
    # σ² = 0.154 C_T² L0^(2/3)
    assert structure_function(50.0, 0.3, outer_scale=2.0) / 2 == pytest.approx(
        0.15371695 * 0.3 * 2 ** (2 / 3),
        rel=1e-7,
        abs=0,
    )


def test_inner_scale_makes_the_structure_function_quadratic():
    # C² l0^(-4/3) r² far below l0 defines km = 5.91 / l0 (printed as 5.92), r^(2/3) far above
    assert pytest.approx(5.92, abs=0.012) == INNER
    assert structure_function(1e-5, inner_scale=0.01) == pytest.approx(
        0.01 ** (-4 / 3) * 1e-10, rel=1e-5, abs=0
    )
    assert structure_function(8.0, inner_scale=0.01) == pytest.approx(4.0, rel=0.01, abs=0)
    # a rotation of the spectrum gives the same as its integral over one axis: variance in both ways
    k = np.geomspace(1e-4, 1e4, 20001)
    spectrum = temperature_spectrum(k, inner_scale=0.01, outer_scale=2.0)
    variance = np.trapezoid(4 * math.pi * k**3 * spectrum, np.log(k))
    far = structure_function(30.0, inner_scale=0.01, outer_scale=2.0)
    assert far == pytest.approx(2 * variance, rel=1e-5, abs=0)


def test_leaving_out_large_eddies_leaves_the_small_ones():
    kept = temperature_spectrum([0.1, 60.0], largest=1.0) / temperature_spectrum([0.1, 60.0])
    assert kept[0] < 1e-6
    assert kept[1] == pytest.approx(1.0, abs=1e-12)
    assert structure_function(0.01, largest=1.0) / structure_function(0.01) == pytest.approx(1.0, abs=0.03)
    # nothing larger: the structure function levels off beyond that size
    assert structure_function(20.0, largest=1.0) == pytest.approx(
        float(structure_function(40.0, largest=1.0)),
        rel=0.01,
        abs=0,
    )


def test_structure_parameters_of_temperature_and_index():
    # n − 1 = 2.7e-4 at 293 K: 0.93e-6 per kelvin; the textbook's 79e-6 p[hPa]/T² is 0.93e-6 too
    slope = math.sqrt(float(cn2_from_ct2(1.0, 293.15, 101325.0)))
    assert slope == pytest.approx(79e-6 * 1013.25 / 293.15**2, rel=0.01, abs=0)
    assert ct2_from_cn2(cn2_from_ct2(0.3, 300.0, 9e4), 300.0, 9e4) == pytest.approx(0.3, rel=1e-12, abs=0)


def test_scales_lessen_the_wander_of_an_image():
    free = angle_of_arrival_variance(*STRONG)
    # far scales change nothing: (k0 D/2)^(1/3) is left, 0.3 %
    assert angle_of_arrival_variance(*STRONG, outer_scale=1e7) / free == pytest.approx(0.9974, abs=2e-3)
    sizes = [angle_of_arrival_variance(*STRONG, outer_scale=scale) / free for scale in (100.0, 5.0, 0.5)]
    assert 1 > sizes[0] > sizes[1] > sizes[2] > 0
    assert angle_of_arrival_variance(*STRONG, inner_scale=0.05, outer_scale=5.0) < sizes[1] * free


def test_two_points_far_apart_move_independently_and_near_ones_together():
    one = angle_of_arrival_variance(*STRONG, wave="spherical", outer_scale=5.0)
    for axis in ("along", "across"):
        far = differential_angle_variance(*STRONG, 500.0, axis=axis, outer_scale=5.0) / one
        near = differential_angle_variance(*STRONG, 1e-3, axis=axis, outer_scale=5.0) / one
        assert far == pytest.approx(2.0, abs=0.02)
        assert near < 0.01
    # for smooth fields the difference along the line is three times as strong as across it
    along, across = (
        differential_angle_variance(*STRONG, 1e-3, axis=axis, outer_scale=5.0) for axis in ("along", "across")
    )
    assert 2.5 < along / across < 3.1


def test_unknown_words_are_refused():
    with pytest.raises(InputError, match="wave: unknown choice"):
        rytov_variance(1e-13, 1000.0, wave="square")
    with pytest.raises(InputError, match="tilt: unknown choice"):
        angle_of_arrival_variance(*STRONG, tilt="up")
