"""What a person says about the turbulence: how strong, between which sizes, how long its eddies live."""

from __future__ import annotations

import itertools
from typing import Annotated, Final, Literal, Self, final

import numpy as np
from pydantic import Field, model_validator

from nigemizu.heat.measures import Kelvin, Metres
from nigemizu.values import Value

__all__ = ["FREE_CONVECTION", "StructureTable", "Turbulence"]

FREE_CONVECTION: Final = -4.0 / 3.0
"""Power of the height with which C_T² falls in free convection (Wyngaard et al. 1971)."""

Pascals = Annotated[float, Field(json_schema_extra={"unit": "Pa"})]
TemperatureStructure = Annotated[float, Field(gt=0, json_schema_extra={"unit": "K2 m-2/3"})]
IndexStructure = Annotated[float, Field(gt=0, json_schema_extra={"unit": "m-2/3"})]
Spacing = Annotated[float, Field(gt=0, json_schema_extra={"unit": "m"})]


@final
class StructureTable(Value):
    """A structure parameter at increasing heights [m]: a power law between two rows, constant beyond.

    Parameters
    ----------
    heights : tuple of float, m
        Above zero and increasing.
    values : tuple of float
        Above zero: C_T² in K² m^(−2/3), or Cn² in m^(−2/3), as the field says that holds the table.

    Examples
    --------
    >>> StructureTable(heights=(1, 8), values=(0.4, 0.025)).at(4.0).round(6)
    np.float64(0.062996)
    """

    heights: tuple[Metres, ...] = Field(min_length=2)
    values: tuple[float, ...] = Field(min_length=2)

    @model_validator(mode="after")
    def _rows(self) -> Self:
        if len(self.heights) != len(self.values):
            raise ValueError(f"{len(self.heights)} heights but {len(self.values)} values")
        if self.heights[0] <= 0 or any(b <= a for a, b in itertools.pairwise(self.heights)):
            raise ValueError("heights: must be above zero and increase")
        if min(self.values) <= 0:
            raise ValueError("values: a structure parameter is above zero")
        return self

    def at(self, height: np.ndarray | float) -> np.ndarray:
        """The structure parameter at `height` [m], in the unit of `values`."""
        height = np.maximum(np.asarray(height, dtype=np.float64), self.heights[0])
        return np.asarray(np.exp(np.interp(np.log(height), np.log(self.heights), np.log(self.values))))


@final
class Turbulence(Value):
    """Random temperature fluctuations with the spectrum of von Kármán and Kolmogorov.

    Exactly one of `ct2` and `cn2` is given, and at least one of `outer_scale` and
    `outer_scale_per_height`.

    Parameters
    ----------
    ct2 : float or StructureTable, K2 m-2/3
        Structure parameter of the temperature. A number holds at `reference_height` and changes with the
        height as (z / reference_height)^exponent.
    cn2 : float or StructureTable, m-2/3
        Structure parameter of the refractive index instead; converted for air of `air_temperature` and
        `air_pressure` at `wavelength`.
    reference_height : float, m
        Where the number was measured.
    exponent : float
        −4/3: free convection over hot ground. −2/3: wind without buoyancy. 0: the same at all heights.
    constant_below : float, m
        Height below which C_T² and the outer scale stay what they are at this height.
    inner_scale : float, m
        Inner scale l0 of the temperature: below it heat conduction smooths the eddies. Some millimetres
        next to the ground. Cells larger than this cut the spectrum at what they can hold.
    outer_scale : float, m, optional
        Outer scale L0: the wavelength beyond which eddies grow no stronger.
    outer_scale_per_height : float, optional
        Outer scale in units of the height above the ground; never above `outer_scale` where both are given.
    largest : float, m, optional
        Leave out, by a smooth filter, the eddies above this wavelength: because a computed flow makes them.
    spacing : (float, float, float), m, optional
        Divide the cells of the air along x, y and z into parts no larger than this before eddies are added,
        so that there is room for eddies smaller than those cells. What bends light that travels along x are
        eddies that are small along y and z: ``[4.0, 0.2, 0.1]`` is a good mesh for it. By default the air's
        own cells are used.
    eddy_lifetime : float, s, or "frozen"
        Time after which an eddy of one metre is another one; larger and smaller eddies in proportion to
        their wavelength^(2/3). ``"frozen"``: for ever, and then the field comes back when the wind has
        blown through the box.
    unresolved : {"left out", "folded"}
        What becomes of eddies that have no room between the cells. ``"left out"``: the grid has the eddies
        that it can hold, and integrals along rows of cells, which bend light, are right for cells of any
        shape. ``"folded"``: the values at the centres of the cells are those of the whole air, with the right
        differences even between neighbours; for nearly cubic cells only, as long cells would carry a small
        eddy over their whole length.
    seed : int
        Every seed is another turbulence with the same statistics. Another grid makes other eddies too.
    air_temperature, air_pressure, wavelength : float, K, Pa and m
        Of the air and the light for which `cn2` is meant.

    Notes
    -----
    Φ_T(k) = A C_T² (k² + k0²)^(−11/6) exp(−k²/km²) [1 − exp(−(k λ/2π)⁴)], A = Γ(8/3) sin(π/3) / 4π²
    = 0.0330, k0 = 2π/L0, km = 5.91/l0, λ = `largest`; without `largest` the bracket is 1. The structure
    function is C_T² r^(2/3) between the scales and C_T² l0^(−4/3) r² below the inner one.

    The factor 2π in k0 makes L0 a wavelength; authors who write k0 = 1/L0 mean a length 2π times smaller.
    Variance and structure parameter then obey σ² = 0.154 C_T² L0^(2/3). In free convection the variance at a
    height z is near 0.67 C_T² z^(2/3), which an `outer_scale_per_height` of 9 reproduces.

    The lifetime τ of an eddy of wave number k is that of the inertial range, ε^(−1/3) k^(−2/3): one metre
    lives 1.4 s where the dissipation rate ε is 0.01 m² s⁻³.

    Limits: the same in all horizontal directions and Gaussian, which real air is not (plumes, sharp fronts,
    intermittency). Temperature only; no bump of the spectrum before the inner scale; humidity is left out.

    References
    ----------
    J. C. Wyngaard, Y. Izumi, S. A. Collins, J. Opt. Soc. Am. 61 (1971) 1646, doi:10.1364/JOSA.61.001646:
    the powers of the height.
    L. C. Andrews, R. L. Phillips, Laser Beam Propagation through Random Media (2005),
    doi:10.1117/3.626196, section 3.3: the spectrum, and the conventions for k0.

    Examples
    --------
    >>> air = Turbulence(ct2=0.1, outer_scale=2.0)
    >>> air.structure_parameter([0.5, 1.0, 2.0]).round(4).tolist()
    [0.252, 0.1, 0.0397]
    """

    ct2: TemperatureStructure | StructureTable | None = None
    cn2: IndexStructure | StructureTable | None = None
    reference_height: Metres = Field(default=1.0, gt=0)
    exponent: float = FREE_CONVECTION
    constant_below: Metres = Field(default=0.0, ge=0)
    inner_scale: Metres = Field(default=0.005, gt=0)
    outer_scale: Metres | None = Field(default=None, gt=0)
    outer_scale_per_height: float | None = Field(default=None, gt=0)
    largest: Metres | None = Field(default=None, gt=0)
    spacing: tuple[Spacing, Spacing, Spacing] | None = None
    eddy_lifetime: Annotated[float, Field(gt=0, json_schema_extra={"unit": "s"})] | Literal["frozen"] = 1.4
    unresolved: Literal["left out", "folded"] = "left out"
    seed: int = Field(default=0, ge=0)
    air_temperature: Kelvin = Field(default=293.15, gt=0)
    air_pressure: Pascals = Field(default=101325.0, gt=0)
    wavelength: Metres = Field(default=550e-9, gt=0)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.ct2 is None) == (self.cn2 is None):
            given = "both" if self.ct2 is not None else "none"
            raise ValueError(f"give exactly one of ct2 and cn2; {given} of them is given")
        if self.outer_scale is None and self.outer_scale_per_height is None:
            raise ValueError("give outer_scale [m], outer_scale_per_height, or both")
        if self.outer_scale is not None and self.outer_scale <= self.inner_scale:
            raise ValueError(
                f"outer_scale: {self.outer_scale:g} m is not above the inner scale of {self.inner_scale:g} m"
            )
        if self.largest is not None and self.largest <= self.inner_scale:
            raise ValueError(
                f"largest: {self.largest:g} m is not above the inner scale of {self.inner_scale:g} m, "
                "so that no eddies are left"
            )
        return self

    def structure_parameter(self, height: np.ndarray | float) -> np.ndarray:
        """C_T² [K² m^(−2/3)] at `height` [m]."""
        height = np.maximum(np.asarray(height, dtype=np.float64), self.constant_below)
        given = self.ct2 if self.ct2 is not None else self.cn2
        assert given is not None
        if isinstance(given, StructureTable):
            value = given.at(height)
        else:
            value = given * (height / self.reference_height) ** self.exponent
        if self.ct2 is not None:
            return np.asarray(value)
        from nigemizu.heat.turbulence.theory import ct2_from_cn2

        return ct2_from_cn2(value, self.air_temperature, self.air_pressure, wavelength=self.wavelength)

    def outer_scale_at(self, height: np.ndarray | float) -> np.ndarray:
        """Outer scale [m] at `height` [m]."""
        height = np.maximum(np.asarray(height, dtype=np.float64), self.constant_below)
        scale = np.full_like(height, np.inf if self.outer_scale is None else self.outer_scale)
        if self.outer_scale_per_height is not None:
            scale = np.minimum(scale, self.outer_scale_per_height * height)
        return scale
