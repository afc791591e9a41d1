"""What spreads and carries the heat: diffusivity and wind, both functions of height."""

from __future__ import annotations

import itertools
import math
from typing import Final, Literal, Self, final

import numpy as np
from pydantic import Field, model_validator

from nigemizu.heat.measures import Degrees, Metres, MetresPerSecond, SquareMetresPerSecond
from nigemizu.values import Value

__all__ = ["Diffusivity", "Wind"]

VON_KARMAN: Final = 0.4


def _check_table(heights: tuple[float, ...], values: tuple[float, ...], name: str) -> None:
    if len(heights) < 2 or len(heights) != len(values):
        raise ValueError(f"a table needs as many heights as {name}, two at least")
    if any(b <= a for a, b in itertools.pairwise(heights)):
        raise ValueError("heights: must increase")


@final
class Diffusivity(Value):
    """How fast heat spreads in the air, as a function of height.

    Parameters
    ----------
    kind : {"molecular", "eddy", "table"}
        ``molecular``: the same everywhere. ``eddy``: molecular + 0.4 friction_velocity (z − sublayer), never
        below molecular and constant above cap_height: the mixing of turbulent air above a sublayer at the
        ground in which eddies have no room. ``table``: linear between `heights`.
    molecular : float, m2 s-1
        Molecular diffusivity of heat; 2.2e-5 in air at 300 K.
    friction_velocity : float, m s-1
        Friction velocity u∗ of ``eddy``.
    sublayer : float, m
        Thickness of the layer next to the ground in which only molecules carry heat: of the order of ten
        times the kinematic viscosity (1.6e-5 m2/s) over u∗, some millimetres.
    cap_height : float, m
        Height above which the eddies' diffusivity stays constant.
    heights, values : tuple of float, m and m2 s-1
        Of ``table``; constant beyond its ends.
    horizontal_factor : float or (float, float)
        Horizontal diffusivity in units of the vertical one; a pair is (along x, along y).
    horizontal : float or (float, float), m2 s-1, optional
        Horizontal diffusivity itself, the same at all heights; used instead of the factor.

    Notes
    -----
    Limits: an eddy diffusivity describes the mean of turbulent air in neutral stratification with the
    constant of von Kármán κ = 0.4; it makes no eddies of its own, and buoyancy is left out.

    Examples
    --------
    >>> Diffusivity(kind="eddy", friction_velocity=0.3, cap_height=2.0).vertical(1.0).round(6)
    np.float64(0.120022)
    """

    kind: Literal["molecular", "eddy", "table"] = "molecular"
    molecular: SquareMetresPerSecond = Field(default=2.2e-5, gt=0)
    friction_velocity: MetresPerSecond = Field(default=0.0, ge=0)
    sublayer: Metres = Field(default=0.0, ge=0)
    cap_height: Metres = Field(default=10.0, gt=0)
    heights: tuple[Metres, ...] = ()
    values: tuple[SquareMetresPerSecond, ...] = ()
    horizontal_factor: float | tuple[float, float] = 1.0
    horizontal: SquareMetresPerSecond | tuple[SquareMetresPerSecond, SquareMetresPerSecond] | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.kind == "table":
            _check_table(self.heights, self.values, "values")
            if min(self.values) <= 0:
                raise ValueError("values: a diffusivity is above zero")
        elif self.heights or self.values:
            raise ValueError(f"heights, values: only for kind 'table', not {self.kind!r}")
        if self.kind != "eddy" and (self.friction_velocity or self.sublayer):
            raise ValueError(f"friction_velocity, sublayer: only for kind 'eddy', not {self.kind!r}")
        if self.kind == "eddy" and not self.friction_velocity:
            raise ValueError("friction_velocity: kind 'eddy' needs one above zero")
        chosen = self.horizontal_factor if self.horizontal is None else self.horizontal
        if min(_pair(chosen)) < 0:
            raise ValueError("horizontal: a diffusivity is not negative")
        return self

    def vertical(self, height: np.ndarray | float) -> np.ndarray:
        """Vertical diffusivity [m2 s-1] at `height` [m]."""
        height = np.asarray(height, dtype=np.float64)
        if self.kind == "table":
            return np.asarray(np.interp(height, self.heights, self.values))
        return np.asarray(
            self.molecular
            + VON_KARMAN
            * self.friction_velocity
            * np.maximum(np.minimum(height, self.cap_height) - self.sublayer, 0.0)
        )

    def sideways(self, height: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Horizontal diffusivities along x and along y [m2 s-1] at `height` [m]."""
        vertical = self.vertical(height)
        if self.horizontal is not None:
            along_x, along_y = _pair(self.horizontal)
            return np.full_like(vertical, along_x), np.full_like(vertical, along_y)
        along_x, along_y = _pair(self.horizontal_factor)
        return vertical * along_x, vertical * along_y

    def resistance(self, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Resistance ∫ dz / K(z) [s m-1] of the air between two heights [m].

        Gauss–Legendre quadrature with 12 nodes between the kinks of the diffusivity: exact to round-off.
        """
        kinks = self.heights if self.kind == "table" else (self.sublayer, self.cap_height)
        parts = [np.clip(kink, lower, upper) for kink in sorted(kinks)]
        pieces = itertools.pairwise([lower, *parts, upper])
        return np.asarray(sum(self._smooth_resistance(*ends) for ends in pieces))

    def _smooth_resistance(self, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        nodes, weights = np.polynomial.legendre.leggauss(12)
        half = 0.5 * (upper - lower)
        heights = (0.5 * (upper + lower))[:, None] + half[:, None] * nodes
        return np.asarray(half * ((1.0 / self.vertical(heights)) @ weights))


def _pair(number: float | tuple[float, float]) -> tuple[float, float]:
    return number if isinstance(number, tuple) else (number, number)


@final
class Wind(Value):
    """Horizontal wind, a function of height alone.

    Parameters
    ----------
    speed : float, m s-1
        At `reference_height` (everywhere for ``uniform``).
    direction : float, degrees
        Direction towards which the air moves, counted from x (0) to y (90).
    shear : {"uniform", "log", "power", "table"}
        ``log``: ln(z / roughness), calm below the roughness length. ``power``: (z / reference)^exponent.
        ``table``: `speeds` at `heights`, linear between and constant beyond (`speed` is then not used).
    roughness : float, m
        Roughness length of ``log``.
    reference_height : float, m
        Height at which `speed` was measured.
    exponent : float
        Of ``power``; 1/7 over smooth ground.
    heights, speeds : tuple of float, m and m s-1
        Of ``table``.

    Examples
    --------
    >>> u, v = Wind(speed=3.0, direction=90.0).velocity(1.0)
    >>> round(float(u), 12), round(float(v), 12)
    (0.0, 3.0)
    """

    speed: MetresPerSecond = Field(default=0.0, ge=0)
    direction: Degrees = 0.0
    shear: Literal["uniform", "log", "power", "table"] = "uniform"
    roughness: Metres = Field(default=0.001, gt=0)
    reference_height: Metres = Field(default=2.0, gt=0)
    exponent: float = Field(default=1 / 7, ge=0)
    heights: tuple[Metres, ...] = ()
    speeds: tuple[MetresPerSecond, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.shear == "table":
            _check_table(self.heights, self.speeds, "speeds")
        elif self.heights or self.speeds:
            raise ValueError(f"heights, speeds: only for shear 'table', not {self.shear!r}")
        if self.shear == "log" and self.reference_height <= self.roughness:
            raise ValueError("reference_height: must lie above the roughness length")
        return self

    def velocity(self, height: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Components along x and y [m s-1] at `height` [m]."""
        height = np.asarray(height, dtype=np.float64)
        match self.shear:
            case "uniform":
                speed = np.full_like(height, self.speed)
            case "log":
                above = np.log(np.maximum(height / self.roughness, 1.0))
                speed = self.speed * above / math.log(self.reference_height / self.roughness)
            case "power":
                speed = self.speed * (np.maximum(height, 0.0) / self.reference_height) ** self.exponent
            case "table":
                speed = np.interp(height, self.heights, self.speeds)
        angle = math.radians(self.direction)
        return speed * math.cos(angle), speed * math.sin(angle)

    @property
    def is_calm(self) -> bool:
        """True when nothing moves."""
        return not any(self.speeds) if self.shear == "table" else self.speed == 0.0
