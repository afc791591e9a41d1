"""Variances of the angle of arrival for Cn² = 1: what turns the motion of a picture into turbulence.

Beside `nigemizu.heat.turbulence.theory`, these forms know that a tile of a picture is no point: its motion is
the mean over the directions within it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gamma, j0, j1

from nigemizu.heat.turbulence.spectrum import INERTIAL, INNER, outer_wave_number, shape
from nigemizu.heat.turbulence.theory import FRIED, fried_parameter

if TYPE_CHECKING:
    from nigemizu.measure.optics import Optics

__all__ = ["TILT", "coherence_length", "difference_forms", "unit_variance"]

FloatArray: TypeAlias = NDArray[np.float64]

_DISC: Final = float(4 * gamma(8 / 3) * gamma(1 / 6) / (2 ** (8 / 3) * gamma(11 / 6) ** 2 * gamma(17 / 6)))
"""∫ x^(−2/3) [2 J1(x)/x]² dx."""

TILT: Final = 2 ** (1 / 3) * INERTIAL * _DISC / (2 * FRIED)
"""0.170 of σ² = 0.170 (λ/D)² (D/r0)^(5/3): gradient tilt along one axis."""

_PATH: Final = 40  # nodes along the path
_WAVES: Final = 3000  # wave numbers


def coherence_length(cn2: ArrayLike, optics: Optics) -> FloatArray:
    """Fried's r0 [m] for `cn2` [m^(−2/3)]; see `nigemizu.heat.turbulence.fried_parameter`.

    Parameters
    ----------
    cn2 : array_like, m-2/3
        Mean over the path; a value that is not above zero gives infinity.
    optics : Optics

    Returns
    -------
    ndarray of float64, m
    """
    one = fried_parameter(1.0, optics.distance, optics.wavelength, wave=optics.wave)
    strength = np.maximum(np.asarray(cn2, dtype=np.float64), 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(one * strength ** (-3 / 5))


def unit_variance(optics: Optics, patch: float = 0.0) -> float:
    """Variance of the angle of arrival along one axis over Cn², rad² m^(2/3).

    Parameters
    ----------
    optics : Optics
    patch : float, rad
        Radius of the round part of the picture over which the angle is averaged; 0 for a point.

    Returns
    -------
    float, rad2 m2/3

    Notes
    -----
    2π² ∫ds w² ∫ κ³ Φ_n(κ)/Cn² F(κ w D/2) F(κ θ z) dκ with F(x) = [2 J1(x)/x]², z = L − s counted from the
    camera, w = 1 for a plane wave and s/L for a spherical one, θ the radius of the patch. For a point and no
    scales it is 0.170 (λ/D)² (D/r0)^(5/3) over Cn²; a pinhole (D = 0) sees all eddies down to the inner
    scale, and has π² A Γ(1/6) (5.91/l0)^(1/3) L, of which a spherical wave has a third.

    Limits: geometrical optics, D not below sqrt(λL); Cn² the same along the path.

    References
    ----------
    G. A. Tyler, J. Opt. Soc. Am. A 11 (1994) 358, doi:10.1364/JOSAA.11.000358: gradient tilt.
    D. L. Fried, Radio Sci. 10 (1975) 71, doi:10.1029/RS010i001p00071: differential angle of arrival.

    Examples
    --------
    >>> from nigemizu.measure import Optics
    >>> round(1e-13 * unit_variance(Optics(distance=1000.0, aperture=0.05, pixel_angle=1e-5)) * 1e10, 4)
    2.8889
    """
    plane = optics.wave == "plane"
    if patch == 0 and optics.outer_scale is None and optics.largest is None:
        if optics.inner_scale == 0:
            moment = _DISC * (optics.aperture / 2) ** (-1 / 3)
            return float(2 * math.pi**2 * INERTIAL * optics.distance * (1.0 if plane else 3 / 8) * moment)
        if optics.aperture == 0:
            moment = float(gamma(1 / 6)) / 2 * (INNER / optics.inner_scale) ** (1 / 3)
            return float(2 * math.pi**2 * INERTIAL * optics.distance * (1.0 if plane else 1 / 3) * moment)
    total = 0.0
    for w, z, share in _path(optics):
        low, _, density = _waves(optics, w * optics.aperture / 2, patch * z, 0.0)
        # below the first wave number the filters are 1
        rest = 3 * INERTIAL * low ** (1 / 3) if optics.outer_scale is None and optics.largest is None else 0.0
        total += share * (float(density.sum()) + rest)
    return 2 * math.pi**2 * optics.distance * total


def difference_forms(optics: Optics, patch: float, separations: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Variance of the difference of the angles of two points over Cn², in two parts.

    Parameters
    ----------
    optics : Optics
    patch : float, rad
        As for `unit_variance`.
    separations : (N,) array_like, rad
        Angles between the two points.

    Returns
    -------
    isotropic, directional : (N,) float64, rad2 m2/3
        The variance is isotropic + cos(2α) directional, α being the angle between the line through the two
        points and the axis along which the angle is measured.

    Notes
    -----
    4π² ∫ds w² ∫ κ³ Φ_n(κ)/Cn² F(κ w D/2) F(κ θ z) [1 − J0(y) + cos(2α) J2(y)] dκ, y = κ z times the
    separation. Whatever moves the whole picture drops out of it.
    """
    apart = np.asarray(separations, dtype=np.float64)
    isotropic, directional = np.zeros(apart.shape), np.zeros(apart.shape)
    for w, z, share in _path(optics):
        _, kappa, density = _waves(
            optics, w * optics.aperture / 2, patch * z, float(apart.max(initial=0.0)) * z
        )
        y = np.maximum(kappa * z * apart[..., None], 1e-8)
        zeroth = j0(y)
        isotropic += share * ((1.0 - zeroth) @ density)
        directional += share * ((2 * j1(y) / y - zeroth) @ density)
    scale = 4 * math.pi**2 * optics.distance
    return scale * isotropic, scale * directional


def _path(optics: Optics) -> list[tuple[float, float, float]]:
    """Nodes along the path: w of the wave, distance z from the camera [m], weight times w²."""
    nodes, weights = np.polynomial.legendre.leggauss(_PATH)
    t = (nodes + 1) / 2
    # denser towards both ends, where the filters change as fractional powers
    place, step = t**3 * (10 - 15 * t + 6 * t * t), 15 * (t * (1 - t)) ** 2 * weights
    w = np.ones(_PATH) if optics.wave == "plane" else place
    z = (1 - place) * optics.distance
    return [(float(a), float(b), float(c)) for a, b, c in zip(w, z, step * w * w, strict=True)]


def _waves(
    optics: Optics, aperture: float, patch: float, apart: float
) -> tuple[float, FloatArray, FloatArray]:
    """Smallest wave number, wave numbers κ [m⁻¹], and κ³ Φ/Cn² F F dκ at them."""
    k0 = float(outer_wave_number(optics.outer_scale))
    widest = max(aperture, patch, optics.inner_scale / INNER, 1e-12)
    low = 1e-4 / max(widest, apart, optics.largest or 0.0)
    low = min(low, 1e-3 * k0) if k0 > 0 else low
    logs = np.linspace(math.log(low), math.log(150.0 / widest), _WAVES)
    kappa = np.exp(logs)
    density = kappa**4 * shape(kappa**2, k0, optics.inner_scale, optics.largest) * (logs[1] - logs[0])
    density[[0, -1]] *= 0.5
    return low, kappa, density * _disc(kappa * aperture) * _disc(kappa * patch)


def _disc(x: FloatArray) -> FloatArray:
    x = np.maximum(x, 1e-8)
    return np.asarray((2 * j1(x) / x) ** 2)
