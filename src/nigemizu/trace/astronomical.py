"""Astronomical refraction: how far the air lifts the stars, by an integral that marches no ray."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.trace._check import number, numbers
from nigemizu.trace.fan import Fan, Setting
from nigemizu.trace.quadrature import Measure
from nigemizu.trace.shells import RadialIndex

__all__ = ["RefractedRays", "RefractionStatus", "astronomical_refraction", "column", "refracted_rays"]

FloatArray: TypeAlias = NDArray[np.float64]


@final
class RefractionStatus(IntEnum):
    """What became of a ray that was followed backwards from the eye."""

    ESCAPED = 0
    HIT = 1
    TRAPPED = 2

    @property
    def message(self) -> str:
        """The same in words."""
        return _MESSAGES[self]


_MESSAGES = {
    RefractionStatus.ESCAPED: "the ray left the air",
    RefractionStatus.HIT: "the ray met the ground",
    RefractionStatus.TRAPPED: "the air turns the ray back before it gets out (a duct)",
}


@final
@dataclass(frozen=True)
class RefractedRays:
    """Rays from the eye out of the air. Every array has the shape of the elevations and the wavelengths.

    Attributes
    ----------
    refraction : float64, rad
        Apparent less true elevation. This and all that follows is NaN unless the ray left the air.
    true_elevation : float64, rad
        Elevation, over the eye's horizon, of the direction in which the ray leaves the air.
    geocentric_angle : float64, rad
        Angle at the centre of the sphere between the eye and the place where the ray leaves the air.
    path_length : float64, m
    excess_path : float64, m
        ∫ (n − 1) ds; the optical path is the sum of this and the path length.
    lowest : float64, m
        Least height on the way: the eye's unless the ray first falls.
    status : intp
        A `RefractionStatus`.
    """

    refraction: FloatArray
    true_elevation: FloatArray
    geocentric_angle: FloatArray
    path_length: FloatArray
    excess_path: FloatArray
    lowest: FloatArray
    status: NDArray[np.intp]


def astronomical_refraction(
    index: RadialIndex,
    apparent_elevation: ArrayLike,
    *,
    radius: float,
    observer_height: float = 0.0,
    top: float | None = None,
    ground: float = 0.0,
    breaks: ArrayLike | None = None,
    into_vacuum: bool = False,
    tolerance: float = 1e-9,
) -> FloatArray:
    """Refraction of rays that reach an eye under given apparent elevations.

    Parameters
    ----------
    index : RadialIndex
        ``index(height)`` returns (n − 1, dn/dh [m⁻¹]) for heights [m], for one wavelength, or for K along
        the last axis.
    apparent_elevation : (...) array_like, rad
        From −π/2 to π/2; below 0 the ray first falls, turns, and rises again.
    radius : float, m
        Of the sphere on which heights are 0.
    observer_height : float, m
        Of the eye.
    top : float, m, optional
        Where the air ends; ``index.top`` when left out.
    ground : float, m
        Height of the ground.
    breaks : (B,) array_like, m, optional
        Heights at which dn/dh, or a derivative of it, jumps; ``index.breaks``, or none, when left out.
    into_vacuum : bool
        Whether the ray is bent once more at the top, where n falls to 1. Without it, what little air the
        index leaves above the top is left out.
    tolerance : float, rad
        Error of the refraction, from 1e-15 to 0.01.

    Returns
    -------
    (...) or (..., K) ndarray of float64, rad
        Apparent less true elevation. NaN for rays that meet the ground, or that the air turns back before
        they get out; `refracted_rays` says which.

    Raises
    ------
    InputError
        An argument is out of range; the index is not finite, jumps, or is not the integral of its slope;
        or it is too rough between the breaks for the integral to settle.

    Notes
    -----
    Along the ray n r cos θ is constant, θ the local elevation, and R = −∫ (dn/dr)/(n F') dθ with
    F' = 1/r + (dn/dr)/n. This form (Auer and Standish) is smooth at the horizon and is used wherever θ
    changes much within a layer; r follows from the invariant by Newton's method. Where θ hardly changes,
    and where F' falls to 0 or below (a ducting inversion), R = −∫ (dn/dr) cot θ/n dr is used, in a ducting
    layer over the square root of the distance from its end. Layers are halved until the 15 points of
    Kronrod and the 7 of Gauss agree.

    Limits: geometrical optics; air in spherical layers. Without `into_vacuum`, the refraction lacks about
    (n − 1) tan z of the top (0.002″ at the horizon for 86 km). Layers in which n r is constant to a part in
    a thousand leave rays that are level in them good to about 1e-7 rad, by rounding. A layer
    thinner than a thirtieth of the distance between breaks is found if n differs across it, not otherwise.

    References
    ----------
    L. H. Auer and E. M. Standish, Astronomical refraction: computational method for all zenith angles,
    Astronomical Journal 119 (2000) 2472, doi:10.1086/301325.
    R. Piessens et al., QUADPACK (1983), doi:10.1007/978-3-642-61786-7 (points of Kronrod).

    Examples
    --------
    >>> def exponential(height):
    ...     excess = 2.9e-4 * np.exp(-height / 8000.0)
    ...     return excess, -excess / 8000.0
    >>> lifted = astronomical_refraction(exponential, np.radians([0.0, 45.0]), radius=6371e3, top=120e3)
    >>> (np.degrees(lifted) * 60).round(3).tolist()  # minutes of arc
    [39.235, 0.995]
    """
    setting = Setting.of(index, radius=radius, eye=observer_height, ground=ground, top=top, breaks=breaks)
    elevations, allowed = _checked(apparent_elevation, tolerance)
    fan = setting.fan(elevations.ravel(), [_bending(allowed)])
    lifted = fan.sums[0] + (_last_bend(setting, fan) if into_vacuum else 0.0)
    return np.asarray(lifted.reshape(elevations.shape + setting.waves))


def refracted_rays(
    index: RadialIndex,
    apparent_elevation: ArrayLike,
    *,
    radius: float,
    observer_height: float = 0.0,
    top: float | None = None,
    ground: float = 0.0,
    breaks: ArrayLike | None = None,
    into_vacuum: bool = False,
    tolerance: float = 1e-9,
) -> RefractedRays:
    """As `astronomical_refraction`, with where the rays go, how long they are, and what became of them.

    Parameters
    ----------
    index, apparent_elevation, radius, observer_height, top, ground, breaks, into_vacuum
        As of `astronomical_refraction`.
    tolerance : float, rad
        Error of both angles. Lengths are good to `tolerance` × `radius`, the excess path to a thousandth
        of that.

    Returns
    -------
    RefractedRays

    Raises
    ------
    InputError
        As `astronomical_refraction`.

    Notes
    -----
    With ds = dθ/(cos θ F'): φ = ∫ cos θ/r ds, and refraction = φ − (θ_top − θ_eye), an identity that the
    tests hold the two integrals to.

    Examples
    --------
    >>> rays = refracted_rays(lambda h: (0.0 * h, 0.0 * h), [0.0, -0.01], radius=6371e3, top=100e3)
    >>> [RefractionStatus(status).name for status in rays.status]
    ['ESCAPED', 'HIT']
    >>> float(rays.path_length[0].round(3))  # √((R + top)² − R²)
    1133225.485
    """
    setting = Setting.of(index, radius=radius, eye=observer_height, ground=ground, top=top, breaks=breaks)
    elevations, allowed = _checked(apparent_elevation, tolerance)
    sphere = setting.air.radius
    measures = [
        _bending(allowed),
        Measure(lambda height, excess, slope: 1.0 / (sphere + height), True, allowed),
        Measure(lambda height, excess, slope: np.ones_like(excess), False, allowed * sphere),
        Measure(lambda height, excess, slope: excess, False, 1e-3 * allowed * sphere),
    ]
    fan = setting.fan(elevations.ravel(), measures)
    status = np.where(fan.hit, RefractionStatus.HIT, RefractionStatus.ESCAPED)
    status = np.where(fan.trapped, RefractionStatus.TRAPPED, status)
    shape = elevations.shape + setting.waves
    lifted, angle, length, excess, lowest, status = (
        part.reshape(shape) for part in (*fan.sums, fan.lowest, status)
    )
    if into_vacuum:
        lifted = lifted + _last_bend(setting, fan).reshape(shape)
    seen = elevations.reshape(elevations.shape + (1,) * len(setting.waves))
    return RefractedRays(lifted, seen - lifted, angle, length, excess, lowest, status)


def column(
    density: Callable[[FloatArray], ArrayLike],
    index: RadialIndex,
    apparent_elevation: ArrayLike,
    *,
    radius: float,
    observer_height: float = 0.0,
    top: float | None = None,
    ground: float = 0.0,
    breaks: ArrayLike | None = None,
    tolerance: float = 1e-9,
) -> FloatArray:
    """Integral of a density along rays that leave the eye: columns of absorbers, air masses.

    Parameters
    ----------
    density : callable
        ``density(height)`` for heights [m] as an array; any unit; of one sign.
    index, apparent_elevation, radius, observer_height, top, ground
        As of `astronomical_refraction`. ``lambda h: (0.0 * h, 0.0 * h)`` keeps the rays straight.
    breaks : (B,) array_like, m, optional
        Of the index and of the density.
    tolerance : float, 1
        Relative error, from 1e-15 to 0.01.

    Returns
    -------
    (...) or (..., K) ndarray of float64, [density] m
        NaN for rays that do not leave the air.

    Raises
    ------
    InputError
        As `astronomical_refraction`.

    Examples
    --------
    >>> air_mass = column(lambda h: np.exp(-h / 8e3) / 8e3, lambda h: (0.0 * h, 0.0 * h), 0.0,
    ...                   radius=6371e3, top=400e3)
    >>> float(air_mass.round(3))
    35.385
    """
    setting = Setting.of(index, radius=radius, eye=observer_height, ground=ground, top=top, breaks=breaks)
    elevations, allowed = _checked(apparent_elevation, tolerance)

    def amount(height: FloatArray, excess: FloatArray, slope: FloatArray) -> FloatArray:
        return np.broadcast_to(np.asarray(density(height), dtype=np.float64), excess.shape)

    fan = setting.fan(elevations.ravel(), [Measure(amount, False, 0.0, allowed)])
    return np.asarray(fan.sums[0].reshape(elevations.shape + setting.waves))


def _checked(apparent_elevation: ArrayLike, tolerance: float) -> tuple[FloatArray, float]:
    """The elevations, and the error allowed in one layer."""
    quarter_turn = np.nextafter(np.pi / 2, 2.0)
    elevations = numbers(
        apparent_elevation,
        "apparent_elevation",
        "radians from -pi/2 to pi/2 (np.radians converts degrees)",
        low=-quarter_turn,
        high=quarter_turn,
    )
    number(tolerance, "tolerance", "radians from 1e-15 to 0.01", above=np.nextafter(1e-15, 0.0), high=0.01)
    return elevations, tolerance / 8.0


def _bending(allowed: float) -> Measure:
    return Measure(lambda height, excess, slope: -slope / (1.0 + excess), True, allowed)


def _last_bend(setting: Setting, fan: Fan) -> FloatArray:
    """Angles (N, K) by which a step of n down to 1 at the top lifts the rays [rad].

    NaN where the step would turn the ray back.
    """
    excess = setting.air.state(setting.shells.heights[-1:])[0]
    sine, cosine = np.sqrt(fan.exit_sine2), np.sqrt(fan.exit_cosine2)
    power = excess * (2.0 + excess)  # n² − 1
    with np.errstate(invalid="ignore"):
        outside = np.sqrt(fan.exit_sine2 - power * fan.exit_cosine2)
    return np.asarray(np.arcsin(cosine * power / ((1.0 + excess) * sine + outside)))
