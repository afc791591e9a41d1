"""The sky of a round Earth: its light, wavelength by wavelength, along bent rays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.air.extinction import Coefficients, Extinction
from nigemizu.errors import InputError
from nigemizu.render import skylight
from nigemizu.render.sun import SUN_RADIUS
from nigemizu.trace.columns import column_rays

__all__ = ["Firmament", "azimuth_nodes", "elevation_nodes", "firmament"]

FloatArray: TypeAlias = NDArray[np.float64]

ELEVATIONS: Final = 120
AZIMUTHS: Final = 48

_FINEST: Final = math.radians(0.05)  # over which the nodes of elevation are evenly spaced, above the horizon
_PIECES: Final = 160  # of a line of sight
_NODE, _GROWTH = 25.0, 0.025  # m and 1: thickest layers at the ground, and their growth with the height

_SUN_HEIGHTS: Final = 48
_SUN_ELEVATIONS: Final = 160
_SUN_RAYS: Final = 200
_SUN_FINE: Final = 1500
_SUN_SCALE: Final = math.radians(0.6)
_LOWEST_SUN: Final = math.radians(-1.8)  # against the geometric horizon: bent rays end there
_SLICES: Final = 8  # of the Sun's disc

_OFTEN_HEIGHTS: Final = 24
_OFTEN_ELEVATIONS: Final = 72
_OFTEN_SCALE: Final = math.radians(6.0)
_OFTEN_RANGE: Final = (math.radians(-20.0), math.radians(90.0))
_OFTEN_DIRECTIONS, _OFTEN_AZIMUTHS, _OFTEN_STEPS = 8, 8, 24  # directions above, and as many below
_DARK: Final = 1e-40  # 1/sr
_COLUMN: Final = 256  # heights at which scattering is tabulated


@final
@dataclass(frozen=True, eq=False)
class Firmament:
    """Light of the sky over a round Earth, seen from one place.

    Attributes
    ----------
    elevation : (E,) float64, rad
        Apparent elevations.
    azimuth : (A,) float64, rad
        From the Sun, 0 to π; the other side is the same.
    radiance : (K, E, A) float64, 1
        Relative to a white matt surface that faces the Sun outside the air, wavelength by wavelength
        (`nigemizu.render.spectrum.Bands`): π times the spectral radiance over the Sun's spectral irradiance.
        The Sun itself is not in it. Of rays that meet the ground it is what the air before it adds.
    transmission : (K, E) float64, 1
        Of the air to space; 0 for rays that do not leave it.
    true_elevation : (K, E) float64, rad
        Beyond the air, against the horizontal of the eye; NaN for rays that do not leave it.
    horizon : float, rad
        Apparent elevation of the ground's edge, in the middle of the wavelengths.
    sun : (K,) float64, 1
        Part of the Sun's irradiance that reaches the eye directly.
    """

    elevation: FloatArray
    azimuth: FloatArray
    radiance: FloatArray
    transmission: FloatArray
    true_elevation: FloatArray
    horizon: float
    sun: FloatArray

    def at(self, elevation: ArrayLike, azimuth: ArrayLike) -> FloatArray:
        """Radiance (K, ...) in directions [rad], linear between the nodes and constant beyond them."""
        height = np.asarray(elevation, dtype=np.float64)
        turn = np.abs(np.asarray(azimuth, dtype=np.float64))
        turn = np.abs(turn - 2 * math.pi * np.round(turn / (2 * math.pi)))
        row, v = _place(self.elevation, height)
        column, w = _place(self.azimuth, turn)
        low, high = (
            (1 - w) * self.radiance[:, i, column] + w * self.radiance[:, i, column + 1]
            for i in (row, row + 1)
        )
        return np.asarray((1 - v) * low + v * high)


def _place(nodes: FloatArray, wanted: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    found = np.clip(np.searchsorted(nodes, wanted, side="right") - 1, 0, len(nodes) - 2)
    part = (wanted - nodes[found]) / (nodes[found + 1] - nodes[found])
    return found, np.clip(part, 0, 1)


def elevation_nodes(horizon: float, count: int = ELEVATIONS) -> FloatArray:
    """Apparent elevations [rad] from the horizon to the zenith, dense above the horizon."""
    last = math.asinh((math.pi / 2 - horizon) / _FINEST)
    nodes = horizon + _FINEST * np.sinh(np.linspace(0, last, count))
    nodes[0], nodes[-1] = horizon + 1e-7, math.pi / 2
    return np.asarray(nodes)


def azimuth_nodes(count: int = AZIMUTHS) -> FloatArray:
    """Azimuths from the Sun [rad], from 0 to π, dense about the Sun."""
    return np.asarray(math.pi * np.linspace(0, 1, count) ** 2)


def firmament(
    z: ArrayLike,
    index: ArrayLike,
    coefficients: Coefficients,
    *,
    radius: float,
    eye: float,
    sun_elevation: float,
    air: Extinction,
    depolarisation: float = 0.0279,
    ground_albedo: float = 0.06,
    elevation: ArrayLike | None = None,
    azimuth: ArrayLike | None = None,
    multiple: bool = True,
) -> Firmament:
    """Compute the light of the sky.

    Parameters
    ----------
    z : (nz,) array_like, m
        Conformal heights z = R ln(r/R), increasing, from the ground to the top of the air.
    index : (K, nz) or (nz,) array_like, 1
        n′ = n e^(z/R) there.
    coefficients : Coefficients
        Of molecules, aerosol and ozone there, each (K, nz), 1/m.
    radius : float, m
        R. For a flat Earth a large one, such as 1e9.
    eye : float, m
        Conformal height of the eye.
    sun_elevation : float, rad
        Of the Sun's middle without air; −8° to 90°.
    air : Extinction
        Whose aerosol's albedo and asymmetry count here.
    depolarisation : float, 1
        Of light that molecules scatter.
    ground_albedo : float, 1
        Of the ground or the sea, which scatters sunlight evenly.
    elevation : (E,) array_like, rad, optional
        Apparent elevations, increasing. Default: 120 from the horizon to the zenith (`elevation_nodes`).
    azimuth : (A,) array_like, rad, optional
        From the Sun, increasing, in 0 to π. Default: 48 (`azimuth_nodes`).
    multiple : bool
        Whether light that was scattered before counts.

    Returns
    -------
    Firmament

    Raises
    ------
    InputError
        An argument is out of range, or shapes disagree.

    Notes
    -----
    Along a bent line of sight L = ∫ T (β_m (P_m S + Ψ) + ϖ β_a (P_a S + Ψ)) dl: T what is left on the way to
    the eye, S the irradiance of direct sunlight, P the phase functions (of molecules with their
    depolarisation, of the aerosol by Henyey and Greenstein), ϖ the aerosol's albedo, Ψ the mean radiance of
    scattered light. S comes from bent rays: what is left, times the squeeze dθ/dθ_true by which refraction
    thins light, averaged over the Sun's disc, so that the Earth's shadow has its penumbra and its red fringe.
    Ψ follows Hillaire: the mean over all directions of light that was scattered once (by true phase
    functions, along straight rays, ground included), times 1/(1 − f), f the part of even light that is
    scattered again before it gets out.

    Limits: no polarisation; second and later scattering is even in all directions; the ground is lit by
    direct sunlight alone; the colours share the middle one's lines of sight (but not their true elevations),
    and the lines to the Sun know layers of no less than 25 m and 2.5 % of the height. Below −8° what is left
    is wrong.

    References
    ----------
    S. Hillaire, A scalable and production ready sky and atmosphere rendering technique, Comput. Graph. Forum
    39 (2020) 13, doi:10.1111/cgf.14050. S. Chandrasekhar (1960), Radiative Transfer, eq. 1-18-262
    (depolarisation). L. G. Henyey, J. L. Greenstein, Astrophys. J. 93 (1941) 70, doi:10.1086/144246.

    Examples
    --------
    >>> z, R = np.linspace(0, 60e3, 121), 6371e3
    >>> beta = 1.4e-5 * np.exp(-z / 8e3) * np.array([[[1.0]], [[0.0]], [[0.0]]])
    >>> view = {"radius": R, "eye": 0.0, "sun_elevation": 0.5, "air": Extinction()}
    >>> sky = firmament(z, np.exp(z / R), Coefficients(*beta), **view)
    >>> float(sky.radiance[0, -1, 0].round(3))
    0.028
    """
    sky = _Air.of(z, index, coefficients, radius, eye)
    if not math.radians(-8.001) <= sun_elevation <= math.pi / 2 + 1e-9:
        raise InputError(
            "the Sun is too low, or not on the sky",
            key="sun_elevation",
            value=sun_elevation,
            expected="radians, -8 to 90 degrees",
        )
    if not (0 <= ground_albedo <= 1 and 0 <= depolarisation < 0.5):
        raise InputError("an albedo or a depolarisation is no part", value=(ground_albedo, depolarisation))
    horizon = sky.horizon()
    rows = (
        elevation_nodes(horizon)
        if elevation is None
        else _nodes(elevation, "elevation", -math.pi / 2, math.pi / 2)
    )
    columns = azimuth_nodes() if azimuth is None else _nodes(azimuth, "azimuth", 0.0, math.pi)
    sun, grid = _sun_table(sky)
    gamma = depolarisation / (2 - depolarisation)
    scattering = (air.aerosol_albedo, air.aerosol_asymmetry, gamma)
    often, often_grid = _often(sky, sun, grid, ground_albedo, scattering, multiple)
    where, depths, status = skylight.sight(
        sky.z, sky.n2[sky.middle], sky.index[sky.middle, sky.eye], sky.eye, rows, *sky.paths(), _PIECES
    )
    radiance = skylight.gather(
        where, depths, columns, sun_elevation, *scattering, sun, grid, often, often_grid
    )
    clear = np.exp(-depths.sum(axis=(1, 2))).T * (status == skylight.ESCAPED)
    true = skylight.places(sky.z, sky.n2, sky.index[:, sky.eye].copy(), sky.eye, radius, rows)
    direct = np.empty(sky.bands)
    height = radius * math.expm1(sky.z[sky.eye] / radius)
    skylight.shine(sun, *grid, height, math.sin(sun_elevation), direct)
    return Firmament(rows, columns, math.pi * radiance.transpose(2, 0, 1), clear, true, horizon, direct)


def _nodes(given: ArrayLike, key: str, low: float, high: float) -> FloatArray:
    nodes = np.asarray(given, dtype=np.float64)
    edge = 1e-9
    if nodes.ndim != 1 or len(nodes) < 2 or not np.all(np.diff(nodes) > 0):
        raise InputError("nodes must increase, two of them at least", key=key, value=nodes.shape)
    if not (low - edge <= nodes[0] and nodes[-1] <= high + edge):
        raise InputError("out of range", key=key, expected=f"radians from {low:g} to {high:g}")
    return nodes


@final
@dataclass(frozen=True, eq=False)
class _Air:
    """The layers, with a node at the eye and none too thick."""

    z: FloatArray
    index: FloatArray  # (K or 1, nz)
    n2: FloatArray
    beta: FloatArray  # (3, K, nz)
    eye: int
    radius: float

    @classmethod
    def of(
        cls, z: ArrayLike, index: ArrayLike, coefficients: Coefficients, radius: float, eye: float
    ) -> _Air:
        given, bent = np.asarray(z, dtype=np.float64), np.atleast_2d(np.asarray(index, dtype=np.float64))
        beta = np.stack([np.atleast_2d(np.asarray(part, dtype=np.float64)) for part in coefficients])
        # What disagrees is refused there.
        column_rays(given, bent, eye=eye, elevation=[1.0], radius=radius, coefficients=beta)
        if not (np.all(beta >= 0) and np.all(np.isfinite(beta))):
            raise InputError("must be 0 or positive, and finite", key="coefficients")
        if not 1e5 <= radius <= 1e12:
            raise InputError("no Earth", key="radius", value=radius, expected="metres, 1e5 to 1e12")
        nodes = np.unique(np.concatenate([given, _thin(given[0], given[-1]), [eye]]))
        n2 = np.array([np.interp(nodes, given, row**2) for row in bent])
        rows = beta.reshape(-1, len(given))
        fine = np.array([np.interp(nodes, given, row) for row in rows]).reshape(*beta.shape[:2], -1)
        return cls(nodes, np.sqrt(n2), n2, fine, int(np.searchsorted(nodes, eye)), radius)

    @property
    def bands(self) -> int:
        return int(self.beta.shape[1])

    @property
    def middle(self) -> int:
        return len(self.n2) // 2

    @property
    def height(self) -> FloatArray:
        return np.asarray(self.radius * np.expm1(self.z / self.radius))

    def paths(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(nz, K) coefficients times n′ e^(z/R), of molecules, aerosol and ozone."""
        stretch = self.index[self.middle] * np.exp(self.z / self.radius)
        first, second, third = (np.ascontiguousarray((part * stretch).T) for part in self.beta)
        return first, second, third

    def horizon(self) -> float:
        """Apparent elevation [rad] of rays that just miss the ground."""
        n = self.index[self.middle]
        return _grazing(n[: self.eye + 1].min() / n[self.eye])


def _grazing(ratio: float) -> float:
    """−arccos of a ratio near 1."""
    return -2 * math.asin(math.sqrt(max(1 - ratio, 0.0) / 2))


def _thin(low: float, high: float) -> FloatArray:
    """Heights [m] from `low` to `high`, at distances that grow with the height."""
    last = math.log1p((high - low) * _GROWTH / _NODE) / _GROWTH
    nodes = low + np.expm1(np.linspace(0, last, math.ceil(last) + 1) * _GROWTH) * _NODE / _GROWTH
    nodes[-1] = high
    return np.asarray(nodes)


def _sun_table(sky: _Air) -> tuple[FloatArray, tuple[float, float, float, float, float]]:
    """What is left of sunlight (heights, elevations, K), and how it is indexed (`skylight.shine`)."""
    base, top = float(sky.height[0]), float(sky.height[-1])
    if not -500 <= base <= 10e3:
        raise InputError("the ground is too high or too low", key="z", value=base)
    nodes = _thin(sky.z[0], sky.z[-1])
    n = np.interp(nodes, sky.z, sky.index[sky.middle])
    beta = np.array([np.interp(nodes, sky.z, row) for row in sky.beta.sum(axis=0)])
    heights = top * np.linspace(0, 1, _SUN_HEIGHTS) ** 2
    ends = np.arcsinh(
        np.array([_LOWEST_SUN, math.pi / 2 + math.acos(sky.radius / (sky.radius + top))]) / _SUN_SCALE
    )
    above = _SUN_SCALE * np.sinh(np.linspace(ends[0], ends[1], _SUN_ELEVATIONS))
    table = np.empty((_SUN_HEIGHTS, _SUN_ELEVATIONS, sky.bands))
    for i, h in enumerate(heights):
        eye = min(max(sky.radius * math.log1p(h / sky.radius), nodes[0]), nodes[-1])
        at_eye = float(np.interp(eye, nodes, n))
        low = _grazing(min(float(n[nodes <= eye].min()), at_eye) / at_eye) + 1e-7
        coarse = _spread(low, _SUN_RAYS, 7.0)
        rays = column_rays(nodes, n, eye=eye, elevation=coarse, radius=sky.radius, coefficients=beta)
        wanted = above - math.acos(sky.radius / (sky.radius + h))
        table[i] = _disc(coarse, rays.true_elevation[0], rays.depth, wanted)
    grid = (float(ends[0]), (_SUN_ELEVATIONS - 1) / float(ends[1] - ends[0]), _SUN_SCALE, top, sky.radius)
    return table, grid


def _spread(low: float, count: int, power: float) -> FloatArray:
    """Elevations from `low` to the zenith, denser at the lower end."""
    return np.asarray(low + (math.pi / 2 - low) * np.sinh(np.linspace(0, power, count)) / math.sinh(power))


def _disc(apparent: FloatArray, true: FloatArray, depth: FloatArray, wanted: FloatArray) -> FloatArray:
    """What is left (n, K) of the Sun's light with its middle at true elevations `wanted` (n,).

    Light from each interval of apparent elevation is counted where it comes from, and the disc takes the
    difference of the running sum over each of its slices: rays may cross.
    """
    out = np.isfinite(true)
    fine = _spread(float(apparent[out][0]), _SUN_FINE, 4.0)
    lift = np.interp(fine, apparent[out], (apparent - true)[out])
    middle = 0.5 * (fine[1:] + fine[:-1])
    place = middle - np.interp(middle, fine, lift)
    left = np.exp(-np.array([np.interp(middle, apparent[out], row[out]) for row in depth]))
    order = np.argsort(place, kind="stable")
    place, light = place[order], (left * np.diff(fine))[:, order]
    running = np.cumsum(light, axis=1) - 0.5 * light
    cuts = np.linspace(-1, 1, _SLICES + 1)
    area = (np.arcsin(cuts) + cuts * np.sqrt(1 - cuts**2)) / math.pi
    edges = np.minimum(wanted, math.pi / 2 - 1.2 * SUN_RADIUS)[:, None] + SUN_RADIUS * cuts
    below = np.array([np.interp(edges, place, row, left=0.0) for row in running])  # (K, n, slices + 1)
    parts = np.diff(below, axis=-1) / np.diff(SUN_RADIUS * cuts)
    return np.asarray((parts @ np.diff(area)).T)


def _often(
    sky: _Air,
    sun: FloatArray,
    grid: tuple[float, float, float, float, float],
    ground: float,
    scattering: tuple[float, float, float],
    multiple: bool,
) -> tuple[FloatArray, tuple[float, float, float]]:
    """Logarithm of the mean radiance of scattered light, and how it is indexed (`skylight.gather`)."""
    ends = np.arcsinh(np.array(_OFTEN_RANGE) / _OFTEN_SCALE)
    index = (float(ends[0]), (_OFTEN_ELEVATIONS - 1) / float(ends[1] - ends[0]), _OFTEN_SCALE)
    if not multiple:
        return np.full((2, _OFTEN_ELEVATIONS, sky.bands), math.log(_DARK)), index
    top = grid[3]
    places = top * np.linspace(0, 1, _COLUMN) ** 2
    column = np.array([np.interp(places, sky.height, row) for row in sky.beta.reshape(-1, len(sky.z))])
    column = np.ascontiguousarray(column.reshape(3, sky.bands, _COLUMN).transpose(2, 0, 1))
    # Dense about the horizon, where most of the light is: the sine of the elevation is ±u².
    u, weight = np.polynomial.legendre.leggauss(_OFTEN_DIRECTIONS)
    u, weight = 0.5 * (u + 1), 0.5 * weight
    mu, weight = np.concatenate([-(u**2), u**2]), np.tile(2 * u * weight, 2)
    found = skylight.isotropic(
        top * np.linspace(0, 1, _OFTEN_HEIGHTS) ** 2,
        _OFTEN_SCALE * np.sinh(np.linspace(ends[0], ends[1], _OFTEN_ELEVATIONS)),
        mu,
        weight,
        (np.arange(_OFTEN_AZIMUTHS) + 0.5) * math.pi / _OFTEN_AZIMUTHS,
        _OFTEN_STEPS,
        column,
        ground,
        *scattering,
        sun,
        grid,
    )
    return np.log(np.maximum(found, _DARK)), index
