"""What a sensor adds to the light: the noise of photons and of reading."""

from __future__ import annotations

from typing import Annotated, final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from nigemizu.values import Value

__all__ = ["Noise", "add_noise"]

_STREAM = 1  # tells the noise from the random numbers of the samples, which have the same seed


@final
class Noise(Value):
    """Noise of a sensor.

    Parameters
    ----------
    full_well : float, electrons
        Electrons that a pixel holds at saturation, where the picture is 1. Photon noise follows from it.
    read_noise : float, electrons
        Standard deviation of what reading a pixel adds.
    """

    full_well: Annotated[float, Field(ge=1, le=1e12, json_schema_extra={"unit": "electrons"})] = 50_000.0
    read_noise: Annotated[float, Field(ge=0, le=1e9, json_schema_extra={"unit": "electrons"})] = 3.0


def add_noise(radiance: NDArray[np.float32], noise: Noise, *, seed: int, frame: int) -> NDArray[np.float32]:
    """A picture as a sensor reads it.

    Parameters
    ----------
    radiance : (height, width, 3) float32
        Linear picture, exposure included.
    noise : Noise
    seed, frame : int
        Each (seed, frame) has its own noise, on whichever worker it is drawn.

    Returns
    -------
    (height, width, 3) float32
        The same with noise, at most 1 but for the noise of reading. Values below 0 are kept: their mean is
        black.

    Notes
    -----
    With the full well W and the linear value L, a pixel holds min(Poisson(L W), W) electrons; normal
    deviates of the read noise are added, and the sum is divided by W.

    Limits: each colour of each pixel is a photosite of its own (no colour mosaic), light arrives as electrons
    (quantum efficiency is part of W), and nothing is rounded to digits.

    References
    ----------
    J. R. Janesick (2007), Photon Transfer, ch. 3, doi:10.1117/3.725073.
    """
    draw = np.random.default_rng(np.random.SeedSequence([seed, frame], spawn_key=(_STREAM,)))
    mean = np.maximum(radiance.astype(np.float64), 0.0) * noise.full_well
    # What is far beyond saturation is saturated whatever is drawn.
    electrons = np.minimum(draw.poisson(np.minimum(mean, 4.0 * noise.full_well + 100.0)), noise.full_well)
    read = draw.normal(0.0, noise.read_noise, size=radiance.shape) if noise.read_noise > 0 else 0.0
    return ((electrons + read) / noise.full_well).astype(np.float32)
