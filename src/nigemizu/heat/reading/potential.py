"""From potential temperature and specific humidity to what the index of refraction needs."""

from __future__ import annotations

import re
from typing import Any, Final, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nigemizu.air import Atmosphere, moist
from nigemizu.errors import InputError
from nigemizu.heat.reading.lazy import computed
from nigemizu.heat.reading.units import PASCAL

__all__ = ["KAPPA", "REFERENCE_PRESSURE", "absolute", "reference_pressure", "with_temperature"]

FloatArray: TypeAlias = NDArray[np.float64]

KAPPA: Final = 2.0 / 7.0
"""R_d/c_p of an ideal gas of molecules of two atoms (Wallace and Hobbs 2006, eq. 3.54: about 0.286)."""

REFERENCE_PRESSURE: Final = 1e5
"""Pa; at which the potential temperature is the temperature, unless the file says otherwise."""

_ATTRIBUTES: Final = ("reference_pressure", "p0", "p00")
_PASSES: Final = 20
_WATER_TO_DRY: Final = moist.WATER_MOLAR_MASS / 0.0289635  # kg mol⁻¹ of dry air


def reference_pressure(array: xr.DataArray, dataset: xr.Dataset, file: str | None) -> float:
    """Pressure [Pa] to which a potential temperature refers.

    Parameters
    ----------
    array : xarray.DataArray
        The potential temperature.
    dataset : xarray.Dataset
        Whose attributes are asked next, and then its scalar of the standard_name ``reference_pressure``.
    file : str, optional
        Named in errors.

    Raises
    ------
    InputError
        It is none between 500 and 1200 hPa.

    Notes
    -----
    A number without a unit is in Pa above 2000, else in hPa.
    """
    scalars = [
        f"{float(known.values)} {known.attrs.get('units', '')}"
        for known in dataset.variables.values()
        if known.ndim == 0 and known.attrs.get("standard_name") == "reference_pressure"
    ]
    given = [attrs[name] for attrs in (array.attrs, dataset.attrs) for name in _ATTRIBUTES if name in attrs]
    if not given and not scalars:
        return REFERENCE_PRESSURE
    text = str([*given, *scalars][0]).strip()
    match = re.fullmatch(r"([-+.\deE]+)\s*(\w*)", text)
    try:
        number, unit = (float(match[1]), match[2]) if match else (np.nan, "")
    except ValueError:
        number, unit = np.nan, ""
    factor = (
        PASCAL.to_si(unit, "reference_pressure", file)[0] if unit else (1.0 if number > 2000.0 else 100.0)
    )
    if not 5e4 <= number * factor <= 1.2e5:
        raise InputError(
            "no pressure that a potential temperature refers to",
            file=file,
            key="reference_pressure",
            value=text,
            expected="about 1000 hPa",
        )
    return number * factor


def absolute(potential: xr.DataArray, pressure: xr.DataArray) -> xr.DataArray:
    """The temperature where the pressure is known, computed when it is read.

    Parameters
    ----------
    potential : xarray.DataArray, K
        With the attribute ``reference_pressure`` (Pa).
    pressure : xarray.DataArray, Pa
        On the same axes, or on some of them.

    Returns
    -------
    xarray.DataArray, K

    Notes
    -----
    T = θ (p/p₀)^κ, κ = R_d/c_p = 2/7, p₀ as the file has it or 1000 hPa. Limits: dry air; water vapour
    lowers κ by 0.28 of its mixing ratio, and programs take κ from 0.2854 to 0.2857: 0.01 K at 900 hPa. Of a
    liquid water potential temperature this is right only where no water is condensed.

    References
    ----------
    J. M. Wallace and P. V. Hobbs, Atmospheric Science, 2nd ed. (2006), eq. 3.54.
    D. Bolton, Mon. Weather Rev. 108 (1980) 1046,
    doi:10.1175/1520-0493(1980)108<1046:TCOEPT>2.0.CO;2, eq. 7.
    """
    reference = float(potential.attrs["reference_pressure"])

    def compute(blocks: list[NDArray[Any]], _: list[NDArray[np.intp]]) -> NDArray[Any]:
        theta, p = (np.asarray(block, dtype=np.float64) for block in blocks)
        return np.asarray(theta * (p / reference) ** KAPPA)

    axes = {str(name): potential[name] for name in potential.dims}
    temperature = computed(compute, [potential, pressure], axes)
    return temperature.rename("air_temperature").assign_attrs(
        units="K", standard_name="air_temperature", long_name="air temperature"
    )


def with_temperature(instant: xr.Dataset, atmosphere: Atmosphere) -> xr.Dataset:
    """One instant of air with its temperature and relative humidity, made from what stands in for them.

    Parameters
    ----------
    instant : xarray.Dataset
        On some of z, y, x, without time. Unchanged if it has neither a potential temperature without a
        temperature nor a specific humidity.
    atmosphere : Atmosphere
        Pressure at height 0, for what the dataset does not hold.

    Returns
    -------
    xarray.Dataset

    Notes
    -----
    Without a pressure in the dataset, that of the horizontal mean at rest is found together with its
    temperature: T = θ (p/p₀)^κ and d ln p/dz = −g/(R_d T_v) are iterated until the pressure stands still.
    Relative humidity h = x_w / (f e_s/p) with x_w = q/ε / (1 − q + q/ε), ε = M_w/M_a, q the specific
    humidity; a negative q, as schemes of advection leave it, is 0, and what is beyond saturation is condensed
    and refracts like vapour no longer: h ≤ 1.
    """
    if "air_temperature" not in instant and "air_potential_temperature" in instant:
        potential = instant["air_potential_temperature"]
        profile = _mean_profile(potential)
        heights = np.asarray(instant["z"].values, dtype=np.float64)
        reference = float(potential.attrs.get("reference_pressure", REFERENCE_PRESSURE))
        pressure = _at_rest(heights, profile, atmosphere, reference)
        exner = xr.DataArray((pressure / reference) ** KAPPA, dims="z")
        instant = instant.assign(air_temperature=potential.variable.astype(np.float64) * exner.variable)
    if "specific_humidity" in instant and "relative_humidity" not in instant:
        humidity = _relative(instant, atmosphere)
        instant = instant.drop_vars("specific_humidity").assign(relative_humidity=humidity)
    return instant


def _mean_profile(array: xr.DataArray) -> FloatArray:
    return np.asarray(array.mean([name for name in array.dims if name != "z"], dtype=np.float64).values)


def _at_rest(heights: FloatArray, theta: FloatArray, atmosphere: Atmosphere, reference: float) -> FloatArray:
    pressure = np.full(heights.shape, atmosphere.surface_pressure)
    for _ in range(_PASSES):
        before = pressure
        pressure = atmosphere.hydrostatic_pressure(heights, theta * (pressure / reference) ** KAPPA)
        if np.allclose(pressure, before, rtol=1e-12, atol=0.0):
            break
    return pressure


def _relative(instant: xr.Dataset, atmosphere: Atmosphere) -> xr.Variable:
    temperature = instant["air_temperature"]
    if "air_pressure" in instant:
        pressure = instant["air_pressure"]
    else:
        heights = np.asarray(instant["z"].values, dtype=np.float64)
        column = atmosphere.hydrostatic_pressure(heights, _mean_profile(temperature))
        pressure = xr.DataArray(column, {"z": instant["z"]}, "z")
    full = xr.broadcast(temperature, pressure, instant["specific_humidity"])
    kelvin, pascal, mass = (part.values for part in full)
    humidity = np.empty(kelvin.shape)
    for level in range(kelvin.shape[0]):  # one after another, for the sake of memory
        q = np.clip(np.asarray(mass[level], dtype=np.float64), 0.0, 1.0)
        fraction = q / _WATER_TO_DRY
        fraction /= 1.0 - q + fraction
        warm, heavy = (np.asarray(part[level], dtype=np.float64) for part in (kelvin, pascal))
        fraction /= moist.vapour_of(warm, heavy, np.ones(()))
        humidity[level] = np.clip(fraction, 0.0, 1.0)
    return xr.Variable(full[0].dims, humidity)
