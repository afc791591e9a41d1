"""What turbulence of known strength does to light: the closed forms that a simulation has to meet.

Weak scattering, homogeneous paths, geometrical optics for the angles. Constants are closed expressions in
Gamma functions; those of the literature are the same numbers rounded.

References
----------
V. I. Tatarskii, The Effects of the Turbulent Atmosphere on Wave Propagation (1971).
D. L. Fried, J. Opt. Soc. Am. 56 (1966) 1372, doi:10.1364/JOSA.56.001372: the parameter r0.
R. J. Noll, J. Opt. Soc. Am. 66 (1976) 207, doi:10.1364/JOSA.66.000207: Zernike tilt.
G. A. Tyler, J. Opt. Soc. Am. A 11 (1994) 358, doi:10.1364/JOSAA.11.000358: gradient tilt, Zernike tilt.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad
from scipy.special import beta, gamma, j0, j1, jn_zeros, jv

from nigemizu.air import refractivity
from nigemizu.errors import InputError
from nigemizu.heat.turbulence.spectrum import INERTIAL, outer_wave_number, shape

__all__ = [
    "FRIED",
    "PHASE_STRUCTURE",
    "RYTOV_LAYER",
    "SEEING",
    "angle_of_arrival_variance",
    "aperture_scintillation",
    "cn2_from_ct2",
    "ct2_from_cn2",
    "differential_angle_variance",
    "fried_parameter",
    "rytov_variance",
]

Wave = Literal["plane", "spherical"]
Tilt = Literal["gradient", "zernike"]

PHASE_STRUCTURE: Final = float(
    8 * math.pi**3 * INERTIAL / (2 ** (8 / 3) * gamma(11 / 6) ** 2 * math.sin(5 * math.pi / 6))
)
"""2.914 of D_φ(ρ) = 2.914 k² Cn² L ρ^(5/3), plane wave."""

SEEING: Final = float(2 * (24 / 5 * gamma(6 / 5)) ** (5 / 6))
"""6.88 of D_φ(ρ) = 6.88 (ρ/r0)^(5/3)."""

FRIED: Final = PHASE_STRUCTURE / SEEING
"""0.423 of r0 = (0.423 k² ∫ Cn² ds)^(−3/5)."""

RYTOV_LAYER: Final = float(
    16 * math.pi**2 * INERTIAL * 0.5 * 2 ** (-5 / 6)
    * (-(2 ** (-1 / 6)) * gamma(-5 / 6) * math.cos(5 * math.pi / 12))
)  # fmt: skip
"""2.25 of σ_I² = 2.25 k^(7/6) ∫ Cn² h^(5/6) dh, plane wave, h counted from the receiver."""


def _light(wavelength: float) -> float:
    return 2 * math.pi / wavelength


def _one_of(value: str, valid: tuple[str, ...], key: str) -> None:
    if value not in valid:
        raise InputError("unknown choice", key=key, value=value, expected=" or ".join(valid))


def cn2_from_ct2(
    ct2: ArrayLike, temperature: ArrayLike, pressure: ArrayLike, *, wavelength: ArrayLike = 550e-9
) -> np.ndarray:
    """Structure parameter of the refractive index from that of the temperature, m^(−2/3).

    Parameters
    ----------
    ct2 : array_like, K2 m-2/3
    temperature, pressure, wavelength : array_like, K, Pa, m

    Notes
    -----
    Cn² = [(n − 1)/T]² C_T²: at constant pressure n − 1 is proportional to 1/T, and eddies are slow enough to
    keep the pressure. n − 1 is `nigemizu.air.refractivity` of dry air.

    Limits: fluctuations small against T; no fluctuations of humidity.

    Examples
    --------
    >>> float(cn2_from_ct2(0.1, 293.15, 101325.0).round(16))
    8.68e-14
    """
    slope = refractivity(temperature, pressure, wavelength=wavelength) / np.asarray(temperature)
    return np.asarray(np.asarray(ct2) * slope**2)


def ct2_from_cn2(
    cn2: ArrayLike, temperature: ArrayLike, pressure: ArrayLike, *, wavelength: ArrayLike = 550e-9
) -> np.ndarray:
    """Structure parameter of the temperature from that of the index, K² m^(−2/3); see `cn2_from_ct2`."""
    slope = refractivity(temperature, pressure, wavelength=wavelength) / np.asarray(temperature)
    return np.asarray(np.asarray(cn2) / slope**2)


def fried_parameter(cn2: float, length: float, wavelength: float = 550e-9, *, wave: Wave = "plane") -> float:
    """Fried's coherence length r0 [m] of a homogeneous path.

    Parameters
    ----------
    cn2 : float, m-2/3
    length, wavelength : float, m
    wave : {"plane", "spherical"}
        Source at infinity, or a point at the other end.

    Notes
    -----
    r0 = (0.423 k² Cn² L)^(−3/5); a spherical wave has 3/8 of the integral. No inner and no outer scale.

    Examples
    --------
    >>> round(fried_parameter(1e-13, 1000.0), 6)
    0.005683
    """
    _one_of(wave, ("plane", "spherical"), "wave")
    share = 1.0 if wave == "plane" else 3 / 8
    return float((FRIED * share * _light(wavelength) ** 2 * cn2 * length) ** (-3 / 5))


def rytov_variance(cn2: float, length: float, wavelength: float = 550e-9, *, wave: Wave = "plane") -> float:
    """Rytov variance of a homogeneous path: the variance of the relative intensity where it is small.

    Parameters
    ----------
    cn2 : float, m-2/3
    length, wavelength : float, m
    wave : {"plane", "spherical"}

    Notes
    -----
    1.23 Cn² k^(7/6) L^(11/6) for a plane, 0.497 of the same for a spherical wave.

    Limits: above about 0.3 the real variance saturates and this number only ranks paths.

    Examples
    --------
    >>> round(rytov_variance(1e-13, 1000.0), 4)
    6.6614
    """
    _one_of(wave, ("plane", "spherical"), "wave")
    share = 6 / 11 if wave == "plane" else float(beta(11 / 6, 11 / 6))
    return float(RYTOV_LAYER * share * cn2 * _light(wavelength) ** (7 / 6) * length ** (11 / 6))


def aperture_scintillation(
    cn2_integral: float, distance: float, aperture: float, wavelength: float = 550e-9
) -> float:
    """Variance of the relative power that a round aperture receives from a star through one thin layer.

    Parameters
    ----------
    cn2_integral : float, m^(1/3)
        ∫ Cn² dh of the layer.
    distance, aperture, wavelength : float, m
        Distance h of the layer, diameter D.

    Notes
    -----
    σ_I² = 16π² k² A ∫Cn²dh ∫ κ^(−8/3) sin²(κ²h/2k) [2 J1(κD/2)/(κD/2)]² dκ. Kolmogorov spectrum, weak.

    Examples
    --------
    >>> round(aperture_scintillation(1e-13, 1e4, 0.1), 5)
    0.02283
    """
    k = _light(wavelength)
    strength = 16 * math.pi**2 * k**2 * INERTIAL * cn2_integral
    if aperture == 0:
        return float(RYTOV_LAYER * k ** (7 / 6) * cn2_integral * distance ** (5 / 6))
    # x = κ sqrt(h / 2k): one sine of x², and a disc of radius a in x
    unit, a = math.sqrt(distance / (2 * k)), aperture / 2 / math.sqrt(distance / (2 * k))

    def integrand(x: float) -> float:
        return float(x ** (-8 / 3) * math.sin(x * x) ** 2 * (2 * j1(a * x) / (a * x)) ** 2)

    ends = [0.0, *_panels(a)]
    total = sum(
        quad(integrand, p, q, epsabs=0, epsrel=1e-9, limit=200)[0] for p, q in itertools.pairwise(ends)
    )
    return float(strength * unit ** (5 / 3) * total)


def _panels(a: float) -> list[float]:
    """Ends of panels between zeros of either factor, far enough for a remainder below 1e-6."""
    last = 40.0
    zeros = np.concatenate([np.sqrt(np.arange(1, int(last**2 / math.pi)) * math.pi), jn_zeros(1, 200) / a])
    return [float(x) for x in np.unique(zeros[zeros < last])] + [last]


def _power(x: np.ndarray | float, tilt: Tilt) -> np.ndarray:
    """Squared filter of a disc for the tilt, x = κ D / 2."""
    x = np.maximum(np.asarray(x, dtype=np.float64), 1e-6)
    return np.asarray((2 * j1(x) / x) ** 2 if tilt == "gradient" else (8 * jv(2, x) / x**2) ** 2)


def _bessel_moment(order: int, power: float) -> float:
    """∫ J_ν(x)² x^(−p) dx, the critical case of Weber and Schafheitlin (Watson 1944, section 13.41)."""
    return float(
        gamma(power) * gamma(order + (1 - power) / 2)
        / (2**power * gamma((1 + power) / 2) ** 2 * gamma(order + (1 + power) / 2))
    )  # fmt: skip


def _kolmogorov_moment(tilt: Tilt) -> float:
    """∫ x^(−2/3) · (filter of the disc) dx."""
    return 4 * _bessel_moment(1, 8 / 3) if tilt == "gradient" else 64 * _bessel_moment(2, 14 / 3)


def angle_of_arrival_variance(
    cn2: float,
    length: float,
    aperture: float,
    *,
    wave: Wave = "plane",
    tilt: Tilt = "gradient",
    inner_scale: float = 0.0,
    outer_scale: float | None = None,
    largest: float | None = None,
) -> float:
    """Variance of the angle of arrival along one axis, rad².

    Parameters
    ----------
    cn2 : float, m-2/3
        Of a homogeneous path.
    length, aperture : float, m
        Length of the path and diameter of the round aperture.
    wave : {"plane", "spherical"}
    tilt : {"gradient", "zernike"}
        Mean slope of the wave over the aperture, which moves the centroid of the image; or slope of the
        plane that fits the wave best.
    inner_scale, outer_scale, largest : float, m
        See `Turbulence`; 0 and None for none.

    Notes
    -----
    2π² ∫ds w² ∫ κ³ Φ_n(κ) F(w κ D/2) dκ, w = 1 for a plane wave and w = s/L for a spherical one (s from the
    source); F(x) = [2 J1(x)/x]² or [8 J2(x)/x²]². Without scales a closed form.

    Limits: geometrical optics, aperture large against sqrt(λL).

    Examples
    --------
    >>> round(1e6 * angle_of_arrival_variance(1e-13, 1000.0, 0.05) ** 0.5, 3)
    27.755
    """
    _one_of(wave, ("plane", "spherical"), "wave")
    _one_of(tilt, ("gradient", "zernike"), "tilt")
    radius = aperture / 2
    if inner_scale == 0 and outer_scale is None and largest is None:
        share = 1.0 if wave == "plane" else 3 / 8
        moment = _kolmogorov_moment(tilt) * radius ** (-1 / 3)
        return float(2 * math.pi**2 * INERTIAL * cn2 * length * share * moment)

    def at(w: float) -> float:
        kappa, weight = _wave_numbers(w * radius, inner_scale, outer_scale, largest)
        return float(np.sum(weight * _power(w * kappa * radius, tilt)))

    return 2 * math.pi**2 * cn2 * length * _along(at, wave)


def _wave_numbers(
    radius: float, inner_scale: float, outer_scale: float | None, largest: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """Wave numbers κ, and κ³ Φ/Cn² dκ at them: dense enough for a disc of this radius."""
    k0 = float(outer_wave_number(outer_scale))
    low = 1e-5 * min(k0 if k0 > 0 else 1e-4 / radius, 1 / radius)
    # the filters fall as x^-3 at least: what is left beyond x = 300 is about 1e-7
    high = 300.0 / radius
    knee = 0.3 / radius
    grown = np.exp(np.linspace(math.log(low), math.log(knee), 600))
    even = np.linspace(knee, high, 6001)
    parts = []
    for points in (grown, even):
        # Gauss-Legendre, three points in each interval
        nodes, weights = np.polynomial.legendre.leggauss(3)
        half, middle = np.diff(points) / 2, (points[1:] + points[:-1]) / 2
        kappa = (middle[:, None] + half[:, None] * nodes).ravel()
        parts.append((kappa, (half[:, None] * weights).ravel()))
    kappa, width = (np.concatenate(pair) for pair in zip(*parts, strict=True))
    return kappa, width * kappa**3 * shape(kappa**2, k0, inner_scale, largest)


def _along(at: Callable[[float], float], wave: Wave) -> float:
    """Mean of w² · at(w) over the path, w = s/L; w = 1 throughout for a plane wave."""
    if wave == "plane":
        return float(at(1.0))
    # w = v³: a Kolmogorov spectrum gives w^(5/3), smooth in v
    nodes, weights = np.polynomial.legendre.leggauss(16)
    v = (nodes + 1) / 2
    return float(sum(1.5 * weight * x**8 * at(x**3) for x, weight in zip(v, weights, strict=True)))


def differential_angle_variance(
    cn2: float,
    length: float,
    aperture: float,
    separation: float,
    *,
    axis: Literal["along", "across"] = "along",
    inner_scale: float = 0.0,
    outer_scale: float | None = None,
    largest: float | None = None,
) -> float:
    """Variance of the difference of the angles under which one aperture sees two points, rad².

    Parameters
    ----------
    cn2, length, aperture
        See `angle_of_arrival_variance`.
    separation : float, m
        Distance of the two points from one another, both at the distance `length` from the aperture.
    axis : {"along", "across"}
        Component of the angle along the line between the points, or across it.
    inner_scale, outer_scale, largest : float, m
        See `Turbulence`.

    Notes
    -----
    4π² ∫ds w² ∫ κ³ Φ_n(κ) [2 J1(x)/x]² [1 − J0(y) ± J2(y)] dκ, w = s/L, x = w κ D/2, and y = κ d (1 − w)
    from the distance of the two rays; + along, − across. Gradient tilt. For a separation beyond the outer
    scale it tends to twice the variance of one point; it is what bends straight edges in a picture, while
    the common part only moves the picture.

    Limits: as for `angle_of_arrival_variance`.

    Examples
    --------
    >>> one = angle_of_arrival_variance(1e-13, 1000.0, 0.05, wave="spherical", outer_scale=5.0)
    >>> both = differential_angle_variance(1e-13, 1000.0, 0.05, 0.2, outer_scale=5.0)
    >>> 0.5 < both / one < 2
    True
    """
    _one_of(axis, ("along", "across"), "axis")
    radius, sign = aperture / 2, 1.0 if axis == "along" else -1.0

    def at(w: float) -> float:
        kappa, weight = _wave_numbers(w * radius, inner_scale, outer_scale, largest)
        y = kappa * separation * (1 - w)
        return float(np.sum(weight * _power(w * kappa * radius, "gradient") * (1 - j0(y) + sign * jv(2, y))))

    return 4 * math.pi**2 * cn2 * length * _along(at, "spherical")
