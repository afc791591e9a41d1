"""The round Earth: its map on which layers are flat, and its gravity."""

from __future__ import annotations

import math
from typing import Annotated, Final, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from nigemizu.values import Value

__all__ = ["Earth"]

FloatArray: TypeAlias = NDArray[np.float64]

# WGS 84: gravity at the equator, Somigliana's constant, square of the eccentricity.
_EQUATOR: Final = 9.7803253359
_SOMIGLIANA: Final = 1.931852652458e-3
_ECCENTRICITY2: Final = 6.69437999014e-3


@final
class Earth(Value):
    """A sphere, and the conformal map that makes it flat.

    Parameters
    ----------
    radius : float, m
        Of the sphere at the sea's surface.
    latitude : float, degrees
        At which gravity is taken.
    flat : bool
        Whether the ground is flat; `radius` then counts for gravity alone.

    Notes
    -----
    With the conformal height z = R ln(1 + h/R) and the distance x = Rφ along the sea, the lengths of the map
    are those of the world divided by e^(z/R). Light therefore goes in the map, in the index n′ = n e^(z/R),
    as it does in the world in n, and makes the same angles with the vertical: the invariant n r cos θ is
    R n′ cos θ.
    Exact in every vertical plane, and so for air in layers.

    References
    ----------
    Gravity: Somigliana's formula, WGS 84 (NIMA TR8350.2, 3rd ed. 2000, eq. 4-1).

    Examples
    --------
    >>> earth = Earth()
    >>> float(earth.height(earth.conformal_height(1000.0)).round(9))
    1000.0
    >>> float(earth.gravity(0.0).round(4))
    9.8062
    """

    radius: Annotated[float, Field(gt=1e3, le=1e12, json_schema_extra={"unit": "m"})] = 6371000.0
    latitude: Annotated[float, Field(ge=-90, le=90, json_schema_extra={"unit": "degree"})] = 45.0
    flat: bool = False

    def conformal_height(self, height: ArrayLike) -> FloatArray:
        """Conformal height z [m] of a height [m] above the sea."""
        h = np.asarray(height, dtype=np.float64)
        return h.copy() if self.flat else self.radius * np.log1p(h / self.radius)

    def height(self, z: ArrayLike) -> FloatArray:
        """Height [m] above the sea of a conformal height [m]."""
        heights = np.asarray(z, dtype=np.float64)
        return heights.copy() if self.flat else self.radius * np.expm1(heights / self.radius)

    def stretch(self, z: ArrayLike) -> FloatArray:
        """Lengths of the world in units of those of the map, e^(z/R), at a conformal height [m]."""
        heights = np.asarray(z, dtype=np.float64)
        return np.ones_like(heights) if self.flat else np.exp(heights / self.radius)

    def gravity(self, height: ArrayLike) -> FloatArray:
        """Gravity [m/s²] at a height [m] above the sea: WGS 84 at the latitude, falling as 1/r²."""
        sine2 = math.sin(math.radians(self.latitude)) ** 2
        at_sea = _EQUATOR * (1 + _SOMIGLIANA * sine2) / math.sqrt(1 - _ECCENTRICITY2 * sine2)
        return np.asarray(at_sea / (1 + np.asarray(height, dtype=np.float64) / self.radius) ** 2)
