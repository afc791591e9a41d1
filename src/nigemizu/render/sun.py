"""The Sun and the Moon as they are seen from outside the air."""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError

__all__ = [
    "MOON_RADIUS",
    "SUN_RADIUS",
    "limb_darkening",
    "moon_radiance",
    "solar_irradiance",
    "sun_radiance",
]

FloatArray: TypeAlias = NDArray[np.float64]

SUN_RADIUS: Final = math.radians(16 / 60)
"""Mean apparent radius of the Sun [rad]."""
MOON_RADIUS: Final = math.radians(0.5181 / 2)
"""Mean apparent radius of the Moon [rad]."""

# Means over steps of 10 nm, the first from 360 to 370 nm, in W m⁻² nm⁻¹.
_START, _STEP = 360e-9, 10e-9
_IRRADIANCE: Final = np.array(
    [
        [1.11776, 1.14259, 1.01249, 1.14716, 1.72765, 1.73054, 1.68870, 1.61253],
        [1.91198, 2.03474, 2.02042, 2.02212, 1.93377, 1.95809, 1.91686, 1.82980],
        [1.86850, 1.89310, 1.85149, 1.85040, 1.83410, 1.83450, 1.81470, 1.78158],
        [1.75330, 1.69650, 1.68194, 1.64654, 1.60480, 1.52143, 1.55622, 1.51130],
        [1.47400, 1.44820, 1.41018, 1.36775, 1.34188, 1.31429, 1.28303, 1.26758],
        [1.23670, 1.20820, 1.18737, 1.14683, 1.12362, 1.10580, 1.07124, 1.04992],
    ]
).reshape(-1)

# Coefficients of μ⁰ … μ⁵ in I(μ)/I(1): each constant + a/λ + b/λ⁵, λ in µm, below and above 422.57 nm.
_JOIN: Final = 422.57e-9
_BELOW: Final = np.array(
    [
        [0.09900, 1.96884, -2.80511, 3.32780, -2.17878, 0.58825],
        [0.010643, -0.010643, 0.0, 0.0, 0.0, 0.0],
        [0.0, -0.009166, 0.024873, -0.029317, 0.018273, -0.004663],
    ]
)
_ABOVE: Final = np.array(
    [
        [0.75267, 0.93874, -1.89287, 2.42234, -1.71150, 0.49062],
        [-0.265577, 0.265577, 0.0, 0.0, 0.0, 0.0],
        [0.0, -0.004095, 0.012582, -0.017117, 0.011977, -0.003347],
    ]
)

_MOON_ALBEDO: Final = 0.12
_MOON_COLOUR: Final = 0.92 - 0.65  # B − V of the Moon less that of the Sun
_BLUE, _GREEN = 440e-9, 550e-9  # m, of the bands B and V
_SURGE: Final = (0.35, 7.0)  # by how much, and up to which phase angle in degrees
_LAST_PHASE: Final = math.radians(150.0)


def solar_irradiance(wavelength: ArrayLike) -> FloatArray:
    """Spectral irradiance of the Sun outside the air, at its mean distance.

    Parameters
    ----------
    wavelength : array_like, m
        360 nm to 840 nm.

    Returns
    -------
    ndarray of float64, W m⁻² nm⁻¹

    Raises
    ------
    InputError
        A wavelength is out of range.

    Notes
    -----
    Linear between means over 10 nm, each at the middle of its step: lines of the Sun are smeared.

    References
    ----------
    ASTM G173-03 (extraterrestrial column, after C. A. Gueymard, Sol. Energy 76 (2004) 423,
    doi:10.1016/j.solener.2003.08.039); the means over 10 nm are those of E. Bruneton, Precomputed Atmospheric
    Scattering, 2017.

    Examples
    --------
    >>> float(solar_irradiance(555e-9).round(3))
    1.85
    """
    light = _within(wavelength, 360e-9, 840e-9)
    return np.asarray(np.interp(light, _START + _STEP * (0.5 + np.arange(_IRRADIANCE.size)), _IRRADIANCE))


def limb_darkening(mu: ArrayLike, wavelength: ArrayLike) -> FloatArray:
    """Radiance of the Sun's disc over its mean.

    Parameters
    ----------
    mu : (N,) array_like, 1
        Cosine of the angle between the ray and the vertical of the Sun's surface, 0 at the limb: at a part s
        of the radius from the middle √(1 − s²).
    wavelength : (K,) array_like, m
        385 nm to 1100 nm.

    Returns
    -------
    (K, N) ndarray of float64, 1
        Its mean over the disc, 2∫ I μ dμ, is 1.

    Raises
    ------
    InputError
        An argument is out of range.

    Notes
    -----
    I(μ)/I(1) is a polynomial of fifth degree in μ whose coefficients are functions of the wavelength.

    References
    ----------
    H. Neckel, Analytical reference functions F(λ) for the Sun's limb darkening and its absolute continuum
    intensities, Sol. Phys. 229 (2005) 13, doi:10.1007/s11207-005-4081-z, from the measurements of H. Neckel
    and D. Labs, Sol. Phys. 153 (1994) 91, doi:10.1007/BF00712494.

    Examples
    --------
    >>> limb_darkening([1.0, 0.5, 0.0], [450e-9, 650e-9]).round(2).tolist()
    [[1.32, 0.85, 0.21], [1.2, 0.9, 0.41]]
    """
    light = np.atleast_1d(_within(wavelength, 385e-9, 1100e-9))[:, None]
    cosine = np.atleast_1d(np.asarray(mu, dtype=np.float64))
    if not np.all((cosine >= 0) & (cosine <= 1)):
        raise InputError("no cosine of an angle on the disc", key="mu", expected="0 to 1")
    micron = 1e6 * light
    below, above = (part[0] + part[1] / micron + part[2] / micron**5 for part in (_BELOW, _ABOVE))
    terms = np.where(light < _JOIN, below, above)  # (K, 6)
    powers = np.arange(terms.shape[1])
    mean = (terms * 2 / (powers + 2)).sum(axis=1, keepdims=True)
    return np.asarray(terms @ cosine ** powers[:, None] / mean)


def sun_radiance(distance: ArrayLike, wavelength: ArrayLike, radius: float = SUN_RADIUS) -> FloatArray:
    """Radiance of the Sun's disc relative to a white matt surface that faces the Sun.

    Parameters
    ----------
    distance : (N,) array_like, 1
        From the middle of the disc, 0 to 1 at the limb.
    wavelength : (K,) array_like, m
        385 nm to 1100 nm.
    radius : float, rad
        Apparent radius.

    Returns
    -------
    (K, N) ndarray of float64, 1

    Raises
    ------
    InputError
        An argument is out of range.

    Examples
    --------
    >>> float(sun_radiance([0.0], [550e-9])[0, 0].round(-2))
    57400.0
    """
    part = np.atleast_1d(np.asarray(distance, dtype=np.float64))
    if not np.all((part >= 0) & (part <= 1)):
        raise InputError("not on the disc", key="distance", expected="0 to 1")
    return limb_darkening(np.sqrt(1 - part**2), wavelength) / math.sin(radius) ** 2


def moon_radiance(wavelength: ArrayLike, phase_angle: float = 0.0) -> FloatArray:
    """Radiance of the Moon relative to a white matt surface that faces the Sun.

    Parameters
    ----------
    wavelength : array_like, m
        360 nm to 840 nm.
    phase_angle : float, rad
        Sun – Moon – eye: 0 to π; 0 is the full Moon.

    Returns
    -------
    ndarray of float64, 1
        To be multiplied by 2μ₀/(μ₀ + μ), μ₀ and μ the cosines of incidence and view at a point of the ball
        (Lommel and Seeliger): 1 all over the full Moon.

    Raises
    ------
    InputError
        An argument is out of range.

    Notes
    -----
    Geometric albedo 0.12 at 550 nm, ∝ λ^1.1 so that B − V is 0.27 more than the Sun's 0.65. With the phase
    angle α in degrees the whole Moon dims by 0.026 α + 4e-9 α⁴ magnitudes; that is divided by what the ball
    by Lommel and Seeliger makes of it, 1 − sin(α/2) tan(α/2) ln cot(α/4). Within 7° of opposition it is
    brighter, by up to 35 %. Beyond 150° the quotient stays what it is there.

    Limits: no maria; the colour does not depend on the phase; no earthshine.

    References
    ----------
    K. Krisciunas and B. E. Schaefer, A model of the brightness of moonlight, PASP 103 (1991) 1033,
    doi:10.1086/132921 (phase and opposition). A. N. Cox (ed.), Allen's Astrophysical Quantities, 4th ed.
    (2000), chapter 12 (albedo and colour).

    Examples
    --------
    >>> moon_radiance([450e-9, 550e-9, 650e-9], math.radians(7.0)).round(3).tolist()
    [0.082, 0.103, 0.124]
    """
    light = _within(wavelength, 360e-9, 840e-9)
    if not 0 <= phase_angle <= math.pi:
        raise InputError("not a phase angle", key="phase_angle", value=phase_angle, expected="0 to pi rad")
    power = 0.4 * _MOON_COLOUR * math.log(10) / math.log(_GREEN / _BLUE)
    angle = min(phase_angle, _LAST_PHASE)
    degrees = math.degrees(angle)
    rise, width = _SURGE
    dimming = 10 ** (-0.4 * (0.026 * degrees + 4e-9 * degrees**4)) / _ball(angle)
    dimming *= 1 + rise * max(0.0, 1 - degrees / width)
    return np.asarray(_MOON_ALBEDO * (light / _GREEN) ** power * dimming)


def _ball(angle: float) -> float:
    """Light of a whole ball by Lommel and Seeliger at a phase angle [rad], that of phase angle 0 being 1."""
    if angle == 0:
        return 1.0
    half = angle / 2
    return 1 - math.sin(half) * math.tan(half) * math.log(1 / math.tan(half / 2))


def _within(wavelength: ArrayLike, low: float, high: float) -> FloatArray:
    light = np.asarray(wavelength, dtype=np.float64)
    if not np.all((light >= low) & (light <= high)):
        raise InputError(
            "wavelength out of range",
            key="wavelength",
            value=light.tolist(),
            expected=f"metres from {low:g} to {high:g}",
        )
    return light
