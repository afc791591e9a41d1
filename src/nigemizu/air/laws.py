"""Refractivity n − 1 of air from its state and the wavelength."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.air import _check, moist
from nigemizu.errors import InputError

__all__ = ["MODELS", "critical_angle", "peck_reeder", "refractivity"]

FloatArray: TypeAlias = NDArray[np.float64]

MODELS: Final = ("ciddor1996", "lehn1978", "gladstone-dale", "edlen-nist")
"""Names of the refractivity laws."""

_LEHN_CONSTANT: Final = 2.26e-4  # m³/kg
# Elements per block: the dozen temporaries of the kernels then stay in a core's own cache.
_BLOCK: Final = 8192


def refractivity(
    temperature: ArrayLike,
    pressure: ArrayLike,
    *,
    relative_humidity: ArrayLike = 0.0,
    vapour_fraction: ArrayLike | None = None,
    wavelength: ArrayLike = 550e-9,
    co2_fraction: ArrayLike = 450e-6,
    model: str = "ciddor1996",
    gladstone_dale_constant: float | None = None,
) -> FloatArray:
    """Refractivity n − 1 of air; the arguments broadcast against each other.

    Parameters
    ----------
    temperature : array_like, K
    pressure : array_like, Pa
        Total pressure.
    relative_humidity : array_like, 1
        From 0 to 1; with respect to ice below 0 °C.
    vapour_fraction : array_like, 1, optional
        Mole fraction of water vapour, in place of the relative humidity. It is what stays the same when a
        parcel of air is heated.
    wavelength : array_like, m
        In vacuum, 300 nm to 1700 nm. The density laws do not disperse.
    co2_fraction : array_like, 1
        Mole fraction of CO₂ (Ciddor's law only).
    model : {"ciddor1996", "lehn1978", "gladstone-dale", "edlen-nist"}
    gladstone_dale_constant : float, m³ kg⁻¹, optional
        K of n = 1 + K ρ; needed by, and only by, ``"gladstone-dale"``.

    Returns
    -------
    ndarray of float64, 1
        n − 1, not n: a difference of 1e-9 keeps its digits.

    Raises
    ------
    InputError
        An argument is out of range, or the model is unknown.

    Notes
    -----
    ``"ciddor1996"``: n − 1 = (ρ_a/ρ_axs)(n_axs − 1) + (ρ_w/ρ_ws)(n_ws − 1), with the densities of the dry
    and of the vapour part by the BIPM 1981/91 equation. ``"lehn1978"``: n − 1 = 2.26e-4 m³/kg · ρ.
    ``"gladstone-dale"``: n − 1 = K ρ; both with the ideal-gas density of `density`. ``"edlen-nist"``: the
    Edlén equation as modified by Birch and Downs and used by NIST.

    Limits: Ciddor's law is fitted for 300–1690 nm, −40…100 °C, 80–120 kPa, 0–100 % humidity, with an
    uncertainty of 2e-8 to 5e-8; hotter air is an extrapolation of its compressibility (within 0.5 % of an
    ideal gas to 1000 K). Phase index, no absorption lines.

    References
    ----------
    P. E. Ciddor, Applied Optics 35 (1996) 1566, doi:10.1364/AO.35.001566.
    W. H. Lehn and M. B. El-Arini, Applied Optics 17 (1978) 3146, doi:10.1364/AO.17.003146.
    K. P. Birch and M. J. Downs, Metrologia 30 (1993) 155, doi:10.1088/0026-1394/30/3/004.

    Examples
    --------
    >>> float(refractivity(288.15, 101325.0, wavelength=633e-9).round(9))
    0.00027653
    >>> hot, cold = refractivity([320.0, 300.0], 101325.0)
    >>> bool(hot < cold)
    True
    """
    law = _LAWS[_check.one_of(model, MODELS, "model")]
    temperature, pressure = _check.kelvin(temperature), _check.pascal(pressure)
    wavelength = _check.checked(
        wavelength,
        "wavelength",
        "metres from 300e-9 to 1700e-9 (green light is 550e-9)",
        low=300e-9,
        high=1700e-9,
    )
    constant = _constant_of(model, gladstone_dale_constant)
    dry, wet = law.coefficients(wavelength, _check.co2(co2_fraction), constant)
    water, water_is_fraction = _water(relative_humidity, vapour_fraction)

    operands = [temperature, pressure, dry, wet, water]
    shapes = [operand.shape for operand in operands]
    try:
        output = np.empty(np.broadcast_shapes(*shapes))
    except ValueError as error:
        raise InputError(
            f"shapes do not fit: temperature {shapes[0]}, pressure {shapes[1]}, moisture {shapes[-1]}",
            key="temperature",
        ) from error
    blocks = np.nditer(
        [*operands, output],
        flags=["external_loop", "buffered", "zerosize_ok"],
        op_flags=[*[["readonly"]] * 5, ["writeonly"]],  # type: ignore[list-item]
        op_dtypes=np.float64,
        buffersize=_BLOCK,
    )
    moist_air = bool(water.any())
    with blocks:
        for t, p, c_dry, c_wet, x, result in blocks:
            fraction = None
            if moist_air:
                fraction = x if water_is_fraction else law.vapour(t, p, x)
                moist.refuse_boiling(fraction)
            law.kernel(t, p, fraction, c_dry, c_wet, result)
    return output if output.ndim else output[()]


def peck_reeder(wavelength: ArrayLike) -> FloatArray:
    """Refractivity of dry air at 15 °C and 101 325 Pa by the dispersion formula of Peck and Reeder.

    Parameters
    ----------
    wavelength : array_like, m
        In vacuum, 230 nm to 1700 nm.

    Returns
    -------
    ndarray of float64, 1
        n − 1.

    Raises
    ------
    InputError
        A wavelength is outside the measurements.

    Notes
    -----
    (n − 1)·1e8 = 5791817/(238.0185 − σ²) + 167909/(57.362 − σ²), σ in µm⁻¹. Ciddor (1996) took over its
    shape and rescaled it by 2e-5 to 5e-5.

    References
    ----------
    E. R. Peck and K. Reeder, Dispersion of air, J. Opt. Soc. Am. 62 (1972) 958,
    doi:10.1364/JOSA.62.000958, eq. 3.

    Examples
    --------
    >>> float(peck_reeder(644.02492e-9).round(11))
    0.00027638092
    """
    checked = _check.checked(
        wavelength, "wavelength", "metres from 230e-9 to 1700e-9", low=230e-9, high=1700e-9
    )
    s = _squared_wavenumber(checked)
    return 1e-8 * (5791817.0 / (238.0185 - s) + 167909.0 / (57.362 - s))


def critical_angle(index_hot: ArrayLike, index_cold: ArrayLike) -> FloatArray:
    """Grazing angle below which light from the cold air turns back before it reaches the hot air.

    Parameters
    ----------
    index_hot, index_cold : array_like, 1
        Full refractive indices n, hot no larger than cold.

    Returns
    -------
    ndarray of float64, rad
        Angle from the layers (from the road), not from their normal.

    Raises
    ------
    InputError
        An index is below 1, or the hot air is the denser one.

    Notes
    -----
    Snell's law n_c cos θ = n_h, written as θ = 2 asin √((n_c − n_h)/(2 n_c)), which keeps its digits.
    Limits: flat layers.

    Examples
    --------
    >>> float(np.degrees(critical_angle(1.0002465, 1.0002632)).round(3))
    0.331
    """
    hot = _check.checked(index_hot, "index_hot", "a refractive index of at least 1", low=1.0)
    cold = _check.checked(index_cold, "index_cold", "a refractive index of at least 1", low=1.0)
    drop = cold - hot
    if drop.size and drop.min() < 0:
        raise InputError(
            "no critical angle: the hot air is optically denser than the cold",
            key="index_hot",
            value=float(hot.max()),
            expected="at most index_cold",
        )
    return 2.0 * np.arcsin(np.sqrt(drop / (2.0 * cold)))


def _constant_of(model: str, constant: float | None) -> float:
    if (model == "gladstone-dale") != (constant is not None):
        raise InputError(
            "the model 'gladstone-dale' needs its constant"
            if constant is None
            else f"the model {model!r} takes no Gladstone-Dale constant",
            key="gladstone_dale_constant",
            value=constant,
            expected="K in m3/kg (air: about 2.26e-4) together with model 'gladstone-dale'",
        )
    if constant is None:
        return _LEHN_CONSTANT
    return float(
        _check.checked(
            constant, "gladstone_dale_constant", "m3/kg, above 0 and at most 0.01", above=0.0, high=0.01
        )
    )


def _water(relative_humidity: ArrayLike, vapour_fraction: ArrayLike | None) -> tuple[FloatArray, bool]:
    """Return the moisture and whether it is a mole fraction."""
    humidity = _check.humidity(relative_humidity)
    if vapour_fraction is None:
        return humidity, False
    if humidity.any():
        raise InputError(
            "moisture given twice", key="vapour_fraction", expected="it or relative_humidity, not both"
        )
    fraction = _check.checked(
        vapour_fraction, "vapour_fraction", "a mole fraction from 0 to 1", low=0.0, high=1.0
    )
    return fraction, True


def _squared_wavenumber(wavelength: FloatArray) -> FloatArray:
    """σ² in µm⁻²."""
    return (1e6 * wavelength) ** -2.0


# Kernels: temperature t [K], pressure p [Pa], vapour's mole fraction x or None when dry, and the two
# coefficients of the law; the refractivity goes to `out`.


def _ciddor_coefficients(
    wavelength: FloatArray, co2_fraction: FloatArray, _: float
) -> tuple[FloatArray, FloatArray]:
    """Refractivity of dry air and of vapour, each over p/(ZT) at its standard state [K/Pa].

    Ciddor's density ratios ρ_a/ρ_axs and ρ_w/ρ_ws are ratios of p x_i M_i/(Z R T) in which R and the
    molar masses cancel, so that only p x_i/(Z T) remains.
    """
    s = _squared_wavenumber(wavelength)
    standard_air = 1e-8 * (5792105.0 / (238.0185 - s) + 167917.0 / (57.362 - s))  # eq. 1: 15 °C, 450 ppm
    dry_air = standard_air * (1.0 + 0.534 * (co2_fraction - 450e-6))  # eq. 2
    vapour = 1.022e-8 * (295.235 + s * (2.6422 + s * (-0.032380 + s * 0.004028)))  # eq. 3: 20 °C, 1333 Pa
    dry_scale = moist.moles_per_gas_constant(np.asarray(288.15), np.asarray(101325.0), None)
    wet_scale = moist.moles_per_gas_constant(np.asarray(293.15), np.asarray(1333.0), np.ones(()))
    return np.asarray(dry_air / dry_scale), np.asarray(vapour / wet_scale)


def _ciddor(
    t: FloatArray, p: FloatArray, x: FloatArray | None, dry: FloatArray, wet: FloatArray, out: FloatArray
) -> None:
    scale = moist.moles_per_gas_constant(t, p, x)
    np.multiply(scale, dry if x is None else dry + x * (wet - dry), out=out)


def _edlen_coefficients(wavelength: FloatArray, _co2: FloatArray, _: float) -> tuple[FloatArray, FloatArray]:
    s = _squared_wavenumber(wavelength)
    standard_air = 1e-8 * (8342.54 + 2406147.0 / (130.0 - s) + 15998.0 / (38.9 - s))
    return np.asarray(standard_air / 96095.43), np.asarray(292.75e-10 * (3.7345 - 0.0401 * s))


def _edlen_vapour(t: FloatArray, p: FloatArray, relative_humidity: FloatArray) -> FloatArray:
    # NIST leaves the enhancement factor out of this law, whose vapour term is a small correction.
    return relative_humidity * moist.saturation_of(t) / p


def _edlen(
    t: FloatArray, p: FloatArray, x: FloatArray | None, dry: FloatArray, wet: FloatArray, out: FloatArray
) -> None:
    celsius = t - 273.15
    np.multiply(p, dry, out=out)
    out *= 1.0 + 1e-8 * (0.601 - 0.00972 * celsius) * p
    out /= 1.0 + 0.0036610 * celsius
    if x is not None:
        out -= wet * x * p / t


def _density_coefficients(
    _wavelength: FloatArray, _co2: FloatArray, constant: float
) -> tuple[FloatArray, FloatArray]:
    return np.asarray(constant), np.zeros(())


def _density_law(
    t: FloatArray, p: FloatArray, x: FloatArray | None, dry: FloatArray, _wet: FloatArray, out: FloatArray
) -> None:
    np.multiply(t, moist.DRY_AIR_GAS_CONSTANT, out=out)
    np.divide(p, out, out=out)
    out *= dry
    if x is not None:
        out /= moist.virtual_factor(x)


class _Law(NamedTuple):
    coefficients: Callable[[FloatArray, FloatArray, float], tuple[FloatArray, FloatArray]]
    kernel: Callable[[FloatArray, FloatArray, FloatArray | None, FloatArray, FloatArray, FloatArray], None]
    vapour: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]


_LAWS: Final[Mapping[str, _Law]] = MappingProxyType(
    {
        "ciddor1996": _Law(_ciddor_coefficients, _ciddor, moist.vapour_of),
        "lehn1978": _Law(_density_coefficients, _density_law, moist.vapour_of),
        "gladstone-dale": _Law(_density_coefficients, _density_law, moist.vapour_of),
        "edlen-nist": _Law(_edlen_coefficients, _edlen, _edlen_vapour),
    }
)
