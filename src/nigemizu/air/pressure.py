"""Hydrostatic pressure of a column whose temperature is given."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.air import _check, moist
from nigemizu.errors import InputError

__all__ = ["hydrostatic_pressure"]

FloatArray: TypeAlias = NDArray[np.float64]


def hydrostatic_pressure(
    height: ArrayLike,
    temperature: ArrayLike,
    *,
    surface_pressure: float = 101325.0,
    relative_humidity: ArrayLike = 0.0,
    gravity: float = 9.80665,
) -> FloatArray:
    """Pressure of air at rest under its own weight, integrated from height 0 upwards.

    Parameters
    ----------
    height : (nz,) array_like, m
        Strictly increasing, not below 0.
    temperature : (nz, ...) array_like, K
        Height runs along the first axis.
    surface_pressure : float, Pa
        Pressure at height 0.
    relative_humidity : array_like, 1
        From 0 to 1, broadcast against `temperature`.
    gravity : float, m s⁻²

    Returns
    -------
    (nz, ...) ndarray of float64, Pa

    Raises
    ------
    InputError
        An argument is out of range, the heights do not increase, or the shapes do not match.

    Notes
    -----
    d ln p/dz = −g/(R_d T_v), with the virtual temperature T_v taken as linear between the heights, for
    which the integral is closed: exact for isothermal and constant-lapse air, second order in the spacing
    otherwise. Below the first height the air has that height's virtual temperature. Limits: ideal gas,
    constant gravity (1e-4 of the pressure drop per 300 m), air at rest.

    References
    ----------
    J. M. Wallace and P. V. Hobbs, Atmospheric Science, 2nd ed. (2006), eqs. 3.17 and 3.29.

    Examples
    --------
    >>> hydrostatic_pressure([0.0, 100.0], [288.15, 287.50]).round(1).tolist()
    [101325.0, 100129.4]
    """
    heights = _check.checked(height, "height", "metres from 0 up", low=0.0)
    temperatures = _check.kelvin(temperature)
    _check.pascal(surface_pressure)
    _check.checked(gravity, "gravity", "m/s2 above 0", above=0.0)
    humidity = _check.humidity(relative_humidity)
    if (
        heights.ndim != 1
        or temperatures.ndim < 1
        or temperatures.shape[0] != heights.size
        or not heights.size
    ):
        raise InputError(
            f"{heights.shape} heights do not match temperatures of shape {temperatures.shape}",
            key="height",
            expected="one height per step of the first axis of the temperature",
        )
    steps = np.diff(heights, prepend=0.0)
    if np.any(steps[1:] <= 0.0):
        index = int(np.argmax(steps[1:] <= 0.0)) + 1
        raise InputError(
            f"heights do not increase at index {index}", key="height", value=float(heights[index])
        )

    def integrate(virtual: FloatArray) -> FloatArray:
        below = np.concatenate([virtual[:1], virtual[:-1]])
        mean = 0.5 * (virtual + below)
        contrast = (virtual - below) / (virtual + below)
        # ∫ dz/T of a linear T is (dz/T_mean) artanh(c)/c, c the contrast; the quotient is 1 at c = 0.
        bend = np.divide(np.arctanh(contrast), contrast, out=np.ones_like(contrast), where=contrast != 0.0)
        bend *= steps.reshape(-1, *[1] * (virtual.ndim - 1)) / mean
        pressures: FloatArray = surface_pressure * np.exp(
            np.cumsum(bend, axis=0) * (-gravity / moist.DRY_AIR_GAS_CONSTANT)
        )
        return pressures

    pressures = integrate(temperatures)
    if humidity.any():
        # The vapour's fraction depends on the pressure; each pass shrinks the error about ten-thousandfold.
        for _ in range(3):
            fraction = moist.vapour_of(temperatures, pressures, humidity)
            moist.refuse_boiling(fraction)
            pressures = integrate(temperatures * moist.virtual_factor(fraction))
    return pressures
