"""Colour: bands of wavelength, what each shows as red, green and blue, and what it takes of objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.render.sun import solar_irradiance

__all__ = ["LUMINANCE", "Bands", "bands", "into_gamut", "matching_functions"]

FloatArray: TypeAlias = NDArray[np.float64]

LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of red, green and blue of linear sRGB."""

# IEC 61966-2-1: X, Y, Z of linear sRGB.
_PRIMARIES: Final = np.array([[0.4124, 0.3576, 0.1805], LUMINANCE, [0.0193, 0.1192, 0.9505]])

_SHORTEST, _LONGEST = 390e-9, 710e-9  # m; what is seen beyond counts to the outermost bands
_EDGES: Final = (492e-9, 582e-9)  # m, between blue, green and red of objects
_SOFTNESS: Final = 14e-9  # m, over which one passes into the other

# CIE 1931 standard observer, from 380 nm to 780 nm in steps of 5 nm.
_MATCHING: Final = np.array(
    [
        np.array(text.split(), dtype=np.float64)
        for text in (
            """
    0.00137 0.00224 0.00424 0.00765 0.01431 0.02319 0.04351 0.07763 0.13438 0.21477 0.2839 0.3285
    0.34828 0.34806 0.3362 0.3187 0.2908 0.2511 0.19536 0.1421 0.09564 0.05795 0.03201 0.0147 0.0049
    0.0024 0.0093 0.0291 0.06327 0.1096 0.1655 0.22575 0.2904 0.3597 0.43345 0.51205 0.5945 0.6784
    0.7621 0.8425 0.9163 0.9786 1.0263 1.0567 1.0622 1.0456 1.0026 0.9384 0.85445 0.7514 0.6424 0.5419
    0.4479 0.3608 0.2835 0.2187 0.1649 0.1212 0.0874 0.0636 0.04677 0.0329 0.0227 0.01584 0.01136
    0.00811 0.00579 0.00411 0.0029 0.00205 0.00144 0.001 0.00069 0.00048 0.00033 0.00023 0.00017 0.00012
    0.00008 0.00006 0.00004
            """,
            """
    0.00004 0.00006 0.00012 0.00022 0.0004 0.00064 0.00121 0.00218 0.004 0.0073 0.0116 0.01684 0.023
    0.0298 0.038 0.048 0.06 0.0739 0.09098 0.1126 0.13902 0.1693 0.20802 0.2586 0.323 0.4073 0.503
    0.6082 0.71 0.7932 0.862 0.91485 0.954 0.9803 0.99495 1 0.995 0.9786 0.952 0.9154 0.87 0.8163 0.757
    0.6949 0.631 0.5668 0.503 0.4412 0.381 0.321 0.265 0.217 0.175 0.1382 0.107 0.0816 0.061 0.04458
    0.032 0.0232 0.017 0.01192 0.00821 0.00572 0.0041 0.00293 0.00209 0.00148 0.00105 0.00074 0.00052
    0.00036 0.00025 0.00017 0.00012 0.00009 0.00006 0.00004 0.00003 0.00002 0.00002
            """,
            """
    0.00645 0.01055 0.02005 0.03621 0.06785 0.1102 0.2074 0.3713 0.6456 1.03905 1.3856 1.62296 1.74706
    1.7826 1.77211 1.7441 1.6692 1.5281 1.28764 1.0419 0.81295 0.6162 0.46518 0.3533 0.272 0.2123 0.1582
    0.1117 0.07825 0.05725 0.04216 0.02984 0.0203 0.0134 0.00875 0.00575 0.0039 0.00275 0.0021 0.0018
    0.00165 0.0014 0.0011 0.001 0.0008 0.0006 0.00034 0.00024 0.00019 0.0001 0.00005 0.00003 0.00002
    0.00001 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0
            """,
        )
    ]
)


@final
@dataclass(frozen=True, eq=False)
class Bands:
    """Bands of visible light, each of them stood for by one wavelength.

    Attributes
    ----------
    wavelength : (K,) float64, m
        In vacuum, increasing.
    to_rgb : (K, 3) float64, 1
        Linear sRGB of a relative radiance of 1 in band k and 0 in all others. A relative radiance of 1 is, at
        every wavelength, that of a perfectly white matt surface that faces the Sun outside the air: π times
        the spectral radiance over the Sun's spectral irradiance. All bands at 1 make luminance 1 in the
        colour of sunlight without air, white being D65. Single bands lie outside the gamut: some parts are
        negative.
    mixing : (K, 3, 3) float64, 1
        ``mixing[k] @ rgb`` is what band k takes of light or an object of that linear sRGB. The sum over the
        bands is the identity: without dispersion colours are what they were.
    """

    wavelength: FloatArray
    to_rgb: FloatArray
    mixing: FloatArray

    def __len__(self) -> int:
        return len(self.wavelength)

    def rgb(self, radiance: ArrayLike) -> FloatArray:
        """Linear sRGB (..., 3) of relative radiances (K, ...) in the bands."""
        return np.asarray(np.tensordot(np.asarray(radiance, dtype=np.float64), self.to_rgb, axes=(0, 0)))


def bands(count: int = 16) -> Bands:
    """Divide visible light into bands.

    Parameters
    ----------
    count : int
        4 to 128.

    Raises
    ------
    InputError
        Another count.

    Notes
    -----
    The bands share 390 nm to 710 nm evenly; what is seen of sunlight beyond counts to the outermost ones.
    With the colour-matching functions c = (x, y, z), the Sun's spectral irradiance E and M from XYZ to linear
    sRGB, to_rgb_k = M ∫ₖ c E dλ / ∫ y E dλ. A band is stood for by its mean wavelength, weighted with
    (x + y + z) E.

    An object's rgb becomes the spectrum Σ_j s_j b_j(λ), b three smooth steps that are nowhere negative and
    add up to 1: blue up to 492 nm, green, and red from 582 nm. Under light whose bands are T_k = to_rgb_k
    (scaled so that all together are white) it has the colour A s, A_ij = Σ_k T_ki b_j(λ_k), and s = A⁻¹ rgb:
    mixing_k = T_k ⊗ (b(λ_k) A⁻¹). Grey objects have flat spectra.

    Limits: spectra of very saturated colours come out negative in places, which shows only as the colour of
    fringes.

    References
    ----------
    CIE 015:2018, table 6 (CIE 1931 standard colorimetric observer). IEC 61966-2-1:1999 (sRGB).

    Examples
    --------
    >>> sixteen = bands()
    >>> len(sixteen), float((sixteen.to_rgb.sum(axis=0) @ LUMINANCE).round(12))
    (16, 1.0)
    >>> sixteen.to_rgb.sum(axis=0).round(2).tolist()
    [1.1, 0.98, 0.94]
    """
    if not 4 <= count <= 128:
        raise InputError("bands of light", key="count", value=count, expected="4 to 128")
    fine = np.arange(380e-9, 780.05e-9, 0.1e-9)
    seen = matching_functions(fine) * solar_irradiance(fine)
    step = (_LONGEST - _SHORTEST) / count
    band = np.clip(((fine - _SHORTEST) // step).astype(np.int64), 0, count - 1)
    inside = (fine >= _SHORTEST) & (fine <= _LONGEST)
    weight = np.where(inside, seen.sum(axis=0), 0.0)
    wavelength = np.bincount(band, weight * fine, count) / np.bincount(band, weight, count)
    xyz = np.stack([np.bincount(band, part, count) for part in seen], axis=1)
    to_rgb = (xyz / seen[1].sum()) @ np.linalg.inv(_PRIMARIES).T
    to_rgb /= float(to_rgb.sum(axis=0) @ LUMINANCE)
    return Bands(wavelength, to_rgb, _mixing(wavelength, to_rgb))


def _mixing(wavelength: FloatArray, to_rgb: FloatArray) -> FloatArray:
    light = to_rgb / to_rgb.sum(axis=0)
    low, high = (1 / (1 + np.exp(-(wavelength - edge) / _SOFTNESS)) for edge in _EDGES)
    basis = np.stack([high, low - high, 1 - low], axis=1)  # red, green, blue: (K, 3)
    spectrum = basis @ np.linalg.inv(light.T @ basis)
    return np.asarray(light[:, :, None] * spectrum[:, None, :])


def matching_functions(wavelength: ArrayLike) -> FloatArray:
    """CIE 1931 colour-matching functions x, y, z (3, ...) [1] at wavelengths [m]; 0 beyond 380 to 780 nm."""
    light = np.asarray(wavelength, dtype=np.float64)
    nodes = 380e-9 + 5e-9 * np.arange(_MATCHING.shape[1])
    return np.stack([np.interp(light, nodes, row, left=0.0, right=0.0) for row in _MATCHING])


def into_gamut(rgb: ArrayLike) -> FloatArray:
    """Colours that a screen can show, in place of those it cannot.

    Parameters
    ----------
    rgb : (..., 3) array_like, 1
        Linear sRGB, some parts perhaps negative.

    Returns
    -------
    (..., 3) float64, 1
        Nowhere negative; unchanged where no part was. What is brighter than 1 stays so.

    Notes
    -----
    A colour with a negative part is mixed with grey of its own luminance, just so much that the part becomes
    0: luminance and hue (along a straight line to white) stay, saturation goes. Without luminance it becomes
    black.

    Examples
    --------
    >>> into_gamut([1.0, -0.1, 0.2]).round(3).tolist()
    [0.67, 0.0, 0.183]
    """
    colour = np.asarray(rgb, dtype=np.float64)
    grey = (colour @ LUMINANCE)[..., None]
    least = colour.min(axis=-1, keepdims=True)
    outside = least < 0
    keep = np.where(outside, grey / np.where(outside, grey - least, 1.0), 1.0)
    mixed = np.where(grey > 0, grey + np.clip(keep, 0, 1) * (colour - grey), 0.0)
    return np.maximum(np.where(outside, mixed, colour), 0.0)
