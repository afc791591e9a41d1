"""How far the picture of a panel must move: integrals over what the air of a film really holds.

Written out here, in wave numbers along the picture's axes, so that nothing in them comes from what makes the
turbulence or from what measures the film.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from scipy.special import gamma, j1

__all__ = ["View", "closed_form", "difference", "variance"]

INERTIAL = float(gamma(8 / 3)) * math.sin(math.pi / 3) / (4 * math.pi**2)
"""0.0330 of Φ_n = 0.0330 Cn² κ^(−11/3)."""

ON_PATH, ON_SCALE, ON_ARC = 32, 500, 32


@dataclass(frozen=True)
class View:
    """A path through even turbulence, and what averages over directions.

    Parameters
    ----------
    length, aperture : float, m
    inner_scale, outer_scale : float, m
    side : float, rad
        Of the square tiles.
    blur : float, rad
        Standard deviation of the Gaussian under which the tiles are compared.
    cell : float, m
        Between values of the index across the path, linear from one to the next; they hold waves down to two
        cells.
    box : (float, float), m, optional
        Extent of the air along the path and across it, periodic. Waves longer than either, whose intervals of
        wave numbers surround zero, are not in it: the mean of a level does not fluctuate.
    """

    length: float
    aperture: float
    inner_scale: float
    outer_scale: float
    side: float = 0.0
    blur: float = 0.0
    cell: float = 0.0
    box: tuple[float, float] | None = None


@functools.cache
def variance(view: View, axis: int) -> float:
    """Variance over Cn² of the angle of arrival along x (0, level) or y (1, upright) [rad² m^(2/3)].

    2π ∫dz w² ∫∫ κ_a² Φ_n(κ)/Cn² [2 J1(x)/x]² (tile)² (cells)² dκ_x dκ_y, w = 1 − z/L, x = w κ D/2.
    """
    return _integral(view, axis, None) - _of_whole_levels(view, axis)


@functools.cache
def difference(view: View, axis: int, separation: float) -> float:
    """The same of the difference between two tiles side by side, `separation` [rad] apart.

    Under the integral stands 2 [1 − cos(κ_x · separation · z)] too, next to nothing for waves that the box
    leaves out.
    """
    return _integral(view, axis, separation)


def closed_form(length: float, aperture: float) -> float:
    """3/8 · 2.914 L D^(−1/3): the textbook's angle of arrival of a spherical wave over Cn².

    2.914 Cn² L D^(5/3) is the mean squared difference of the phase between the ends of a diameter, over k²
    (Tatarskii 1971; Andrews and Phillips 2005). The slope averaged over the disc has 2.838 in its place.
    """
    return 3 / 8 * 2.914 * length * aperture ** (-1 / 3)


def _integral(view: View, axis: int, separation: float | None) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(ON_PATH)
    # dense where the cone of light is narrow: w = v²
    v = (nodes + 1) / 2
    w = (v * v)[:, None, None]
    k0, km = 2 * math.pi / view.outer_scale, 5.91 / view.inner_scale
    logarithm = np.linspace(math.log(1e-3 * k0), math.log(5 * km), ON_SCALE)
    k = np.exp(logarithm)[None, :, None]
    # a quarter of the circle stands for all of it
    angle = ((np.arange(ON_ARC) + 0.5) * math.pi / 2 / ON_ARC)[None, None, :]
    kx, ky, z = k * np.cos(angle), k * np.sin(angle), (1 - w) * view.length
    x = np.maximum(w * k * view.aperture / 2, 1e-9)
    seen = (2 * j1(x) / x * _mean(kx * view.side * z) * _mean(ky * view.side * z)) ** 2
    seen = seen * np.exp(-((k * z * view.blur) ** 2))
    if view.cell:
        seen = seen * _mean(kx * view.cell) ** 4 * (kx <= math.pi / view.cell)
    if separation is not None:
        seen = seen * 2 * (1 - np.cos(kx * separation * z))
    spectrum = INERTIAL * (k**2 + k0**2) ** (-11 / 6) * np.exp(-((k / km) ** 2))
    turned = 2 * math.pi * np.mean((ky if axis else kx) ** 2 * k**2 * spectrum * seen, axis=2)
    over_waves = np.sum(turned, axis=1) * (logarithm[1] - logarithm[0])
    return float(2 * math.pi * view.length * np.sum(weights * v * w[:, 0, 0] ** 2 * over_waves))


def _of_whole_levels(view: View, axis: int) -> float:
    """What the waves would add that the box leaves out: they are the same all along the path.

    (2π / length) ∫∫ κ_a² Φ_n(κ)/Cn² |∫dz w F (tile)|² dκ_x dκ_y over |κ_x| < π / width.
    """
    if view.box is None:
        return 0.0
    length, width = view.box
    nodes, weights = np.polynomial.legendre.leggauss(ON_PATH)
    v = (nodes + 1) / 2
    w, step = v * v, view.length * weights * v
    k0, km = 2 * math.pi / view.outer_scale, 5.91 / view.inner_scale
    across, weights_x = np.polynomial.legendre.leggauss(24)
    kx = (math.pi / width * across)[:, None, None]
    u = np.linspace(0, math.asinh(4 * km / k0), ON_SCALE)
    ky = (k0 * np.sinh(u))[None, :, None]
    k, z = np.hypot(kx, ky), (1 - w) * view.length
    x = np.maximum(w * k * view.aperture / 2, 1e-9)
    tile = _mean(kx * view.side * z) * _mean(ky * view.side * z) * np.exp(-((k * z * view.blur) ** 2) / 2)
    along = np.sum(2 * j1(x) / x * tile * w * step, axis=2)
    k, kx, ky = k[..., 0], kx[..., 0], ky[..., 0]
    spectrum = INERTIAL * (k**2 + k0**2) ** (-11 / 6) * np.exp(-((k / km) ** 2))
    both = (
        np.sum((ky if axis else kx) ** 2 * spectrum * along**2 * weights_x[:, None], axis=0) * math.pi / width
    )
    return float(2 * math.pi / length * np.sum(both * 2 * k0 * np.cosh(u)) * (u[1] - u[0]))


def _mean(phase: np.ndarray) -> np.ndarray:
    """Mean of a wave over an interval across which its phase grows by `phase`."""
    return np.sinc(phase / (2 * math.pi))
