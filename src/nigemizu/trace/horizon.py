"""The horizon of the sea through air over a round Earth, and the curvature of level rays."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.trace._check import number, numbers
from nigemizu.trace.fan import Setting, wave_shape
from nigemizu.trace.quadrature import Measure
from nigemizu.trace.shells import RadialIndex, SphericalAir

__all__ = ["Horizon", "horizon", "refraction_coefficient"]

FloatArray: TypeAlias = NDArray[np.float64]


class Horizon(NamedTuple):
    """The line where the sea ends.

    Attributes
    ----------
    dip : (...) or (..., K) float64, rad
        Angle by which it lies below the level of the eye.
    distance : (...) or (..., K) float64, m
        To it, along the surface of the sphere.
    """

    dip: FloatArray
    distance: FloatArray


def horizon(
    index: RadialIndex,
    observer_height: ArrayLike,
    *,
    radius: float,
    ground: float = 0.0,
    breaks: ArrayLike | None = None,
    tolerance: float = 1e-12,
) -> Horizon:
    """Dip and distance of the refracted horizon.

    Parameters
    ----------
    index : RadialIndex
        As of `nigemizu.trace.astronomical_refraction`.
    observer_height : (...) array_like, m
        Heights of eyes, from the ground up.
    radius : float, m
        Of the sphere on which heights are 0.
    ground : float, m
        Height of the surface of the sea.
    breaks : (B,) array_like, m, optional
        Heights at which dn/dh jumps; ``index.breaks``, or none, when left out.
    tolerance : float, rad
        Error of the angle at the centre of the sphere between eye and horizon.

    Returns
    -------
    Horizon
        NaN where there is none: a duct between the eye and the surface keeps rays that graze the surface
        from reaching the eye, which then sees the sea to its limit nowhere.

    Raises
    ------
    InputError
        An argument is out of range, or the index cannot be used.

    Notes
    -----
    Bouguer's invariant: n_g (R + ground) = n_h (R + h) cos(dip). The distance is R φ with
    φ = ∫ dθ/(r F') along the ray that grazes the surface, see `nigemizu.trace.astronomical_refraction`.
    Limits: a smooth sea; air in spherical layers.

    References
    ----------
    A. T. Young, Understanding astronomical refraction, The Observatory 126 (2006) 82.

    Examples
    --------
    >>> seen = horizon(lambda h: (0.0 * h, 0.0 * h), 100.0, radius=6371e3)
    >>> float((np.degrees(seen.dip) * 60).round(3)), float((seen.distance / 1e3).round(3))
    (19.261, 35.696)
    """
    surface = number(ground, "ground", "metres")
    heights = numbers(
        observer_height, "observer_height", f"metres from the ground at {surface:g}", low=surface
    )
    number(tolerance, "tolerance", "radians from 1e-15 to 0.01", above=np.nextafter(1e-15, 0.0), high=0.01)
    shape = heights.shape + wave_shape(index, surface)
    dip, distance = np.empty(shape), np.empty(shape)
    for place in np.ndindex(heights.shape):
        dip[place], distance[place] = _one(index, float(heights[place]), radius, surface, breaks, tolerance)
    return Horizon(dip, distance)


def _one(
    index: RadialIndex, eye: float, radius: float, ground: float, breaks: ArrayLike | None, tolerance: float
) -> Horizon:
    """Where the ray that leaves the ground level meets the height of the eye."""
    if eye == ground:
        nothing = np.zeros(wave_shape(index, ground))
        return Horizon(nothing, nothing)
    setting = Setting.of(index, radius=radius, eye=ground, ground=ground, top=eye, breaks=breaks)
    sphere = setting.air.radius
    angle = Measure(lambda height, excess, slope: 1.0 / (sphere + height), True, tolerance / 8.0)
    fan = setting.fan(np.zeros(1), [angle])
    dip = np.arctan2(np.sqrt(fan.exit_sine2), np.sqrt(fan.exit_cosine2))
    return Horizon(dip.reshape(setting.waves), (sphere * fan.sums[0]).reshape(setting.waves))


def refraction_coefficient(index: RadialIndex, height: ArrayLike, *, radius: float) -> FloatArray:
    """Terrestrial refraction coefficient: the curvature of a level ray in units of the Earth's.

    Parameters
    ----------
    index : RadialIndex
        As of `nigemizu.trace.astronomical_refraction`.
    height : (...) array_like, m
    radius : float, m
        Of the sphere on which heights are 0.

    Returns
    -------
    (...) or (..., K) ndarray of float64, 1
        About 0.17 in the standard atmosphere at sea level, 0.13 by day over land; 1 and more in a duct;
        below 0 where an inferior mirage forms.

    Raises
    ------
    InputError
        A height is not finite.

    Notes
    -----
    k = −(r/n) dn/dr; rays behave over short distances as straight rays over a sphere of the radius R/(1 − k).

    References
    ----------
    C. Hirt et al., Monitoring of the refraction coefficient in the lower atmosphere, J. Geophys. Res. 115
    (2010) D21102, doi:10.1029/2010JD014067.

    Examples
    --------
    >>> def exponential(height):
    ...     excess = 2.9e-4 * np.exp(-height / 8000.0)
    ...     return excess, -excess / 8000.0
    >>> float(refraction_coefficient(exponential, 0.0, radius=6371e3).round(4))
    0.2309
    """
    radius = number(radius, "radius", "metres above 0 (the mean Earth has 6371e3)", above=0.0)
    heights = numbers(height, "height", "metres")
    excess, slope = SphericalAir(index, radius).state(heights[..., None])
    found = -(radius + heights[..., None]) * slope / (1.0 + excess)
    return found if wave_shape(index, 0.0) else found[..., 0]
