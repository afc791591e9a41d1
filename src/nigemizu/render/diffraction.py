"""Diffraction at a round aperture: the Airy pattern, as a sensor of square pixels sees it."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["WAVELENGTHS", "diffract", "transfer"]

WAVELENGTHS: Final = (610e-9, 540e-9, 460e-9)
"""Of red, green and blue, m."""

Vector = NDArray[np.float64]

_FEW: Final = 2  # cells to each side of which all are summed at every frequency
_DEGREE: Final = 47
_FINEST: Final = 0.01  # pixels


def diffract(radiance: NDArray[np.float32], scales: Sequence[float]) -> NDArray[np.float32]:
    """Spread the light of every pixel by diffraction.

    Parameters
    ----------
    radiance : (height, width, channels) float32
        Linear picture.
    scales : sequence of float, pixels
        λN of each channel (`nigemizu.render.Camera.airy_scale`), N being the f-number.

    Returns
    -------
    (height, width, channels) float32
        The convolution with the Airy pattern that is integrated over each pixel. Its sum is that of
        `radiance`: at the edges the picture is taken to go on as its own mirror image, so that as much light
        comes in from beyond as goes out.

    Notes
    -----
    The mirrored picture is periodic, with twice the width and height. Its Fourier series is multiplied by
    `transfer`: the pattern is neither cut off nor sampled anywhere between the pixels' own integrals.

    Limits: a bright point counts as if it lay in the middle of its pixel. What really lies beyond the edges
    is not known; its light reaches a few λN into the picture.
    """
    height, width, _ = radiance.shape
    blurred = np.empty(radiance.shape, dtype=np.float32)
    for channel, scale in enumerate(scales):
        plane = radiance[..., channel].astype(np.float64)
        plane = np.concatenate([plane, plane[::-1]], axis=0)
        spectrum = np.fft.rfft2(np.concatenate([plane, plane[:, ::-1]], axis=1))
        quarter = transfer(height, width, scale)
        spectrum *= np.concatenate([quarter, quarter[-2:0:-1]], axis=0)
        spread = np.fft.irfft2(spectrum, s=(2 * height, 2 * width))[:height, :width]
        # The pattern is nowhere negative; rounding is.
        blurred[..., channel] = np.maximum(spread, 0.0) if plane.min() >= 0 else spread
    return blurred


@functools.lru_cache(maxsize=6)
def transfer(height: int, width: int, scale: float) -> Vector:
    """Fourier transform of the pixel-integrated Airy pattern, sampled at the pixels.

    Parameters
    ----------
    height, width : int
        Of the picture.
    scale : float, pixels
        λN.

    Returns
    -------
    (height + 1, width + 1) float64, 1
        At the frequencies k / (2 height) and l / (2 width), cycles per pixel.

    Notes
    -----
    The optical transfer function of a round aperture with the cut-off 1/(λN) is
    H(s) = (2/π)(arccos s − s √(1 − s²)), s being the frequency times λN; a square pixel multiplies it by
    sinc(f) sinc(g). Frequencies that differ by whole cycles per pixel look alike at the pixels, so that
    their values are summed: Σ H sinc sinc over f + a, g + b, which ends at the cut-off. It is 1 at f = g = 0.

    Where λN is below half a pixel there are many of them. All but the first are smooth between 0 and half a
    cycle: their sum is a polynomial through Chebyshev points, within 3·10⁻⁶.

    Limits: below a hundredth of a pixel, λN is taken as that.

    References
    ----------
    J. W. Goodman (2005), Introduction to Fourier Optics, 3rd ed., eq. 6-32; M. Born and E. Wolf (1999),
    Principles of Optics, 7th ed., §8.5.2, doi:10.1017/CBO9781139644181.
    """
    scale = max(scale, _FINEST)
    f, g = np.arange(width + 1) / (2 * width), np.arange(height + 1) / (2 * height)
    total = _term(f, g, scale)
    if math.floor(1.0 / scale + 0.5) <= _FEW:
        total += _further_terms(f, g, scale)
    else:
        points = np.polynomial.chebyshev.chebpts1(_DEGREE + 1)
        inverse = np.linalg.inv(_chebyshev(points))
        nodes = (points + 1) / 4
        total += (
            _chebyshev(4 * g - 1)
            @ (inverse @ _further_terms(nodes, nodes, scale) @ inverse.T)
            @ (_chebyshev(4 * f - 1).T)
        )
    total[0, 0] = 1.0  # to the last digit: no light is lost
    total.flags.writeable = False
    return total


def _further_terms(f: Vector, g: Vector, scale: float) -> Vector:
    """What frequencies beyond those of the pixels add, (len(g), len(f))."""
    total = np.zeros((len(g), len(f)))
    reach = math.floor(1.0 / scale + 0.5)
    for b in range(-reach, reach + 1):
        for a in range(-reach, reach + 1):
            # The nearest that a frequency of this cell comes to 0, f and g being within 0 and a half.
            nearest = math.hypot(max(a, -a - 0.5), max(b, -b - 0.5))
            if (a, b) != (0, 0) and nearest * scale < 1.0:
                total += _term(f + a, g + b, scale)
    return total


def _term(f: Vector, g: Vector, scale: float) -> Vector:
    lens = _lens(np.hypot(f, g[:, None]) * scale)
    return np.asarray(lens * np.sinc(f) * np.sinc(g)[:, None])


def _chebyshev(x: Vector) -> Vector:
    return np.asarray(np.polynomial.chebyshev.chebvander(x, _DEGREE))


def _lens(s: Vector) -> Vector:
    """Optical transfer function of a round aperture; s is 1 at the cut-off."""
    s = np.minimum(s, 1.0)
    return np.asarray((2 / np.pi) * (np.arccos(s) - s * np.sqrt(1.0 - s * s)))
