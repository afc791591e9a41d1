"""A far view over cold water: air that varies with height alone, along tens of kilometres."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nigemizu.cli.bench.rays import control, settle, stratified_field
from nigemizu.cli.bench.timing import OFTEN, alternate
from nigemizu.progress import SILENT, ProgressMeter

__all__ = ["inversion", "stratified_seconds"]

FloatArray = NDArray[np.float64]

DISTANCE: Final = 40_000.0  # m
ACCURACY: Final = 1e-6  # rad
EARTH_RADIUS: Final = 6_371_000.0  # m
EYE: Final = 10.0  # m
PIXEL: Final = 1.5e-5  # rad; 960 of them are 0.8°, the view of a 2500 mm lens


def inversion() -> tuple[FloatArray, FloatArray]:
    """Air that is 9 K warmer above 25 m than over the water, made flat.

    Returns
    -------
    z : (N,) ndarray of float64, m
    refractivity : (N,) ndarray of float64, 1
        n' − 1 with n' = n exp(z/R): over a plane, light travels in n' as it does in n over the Earth.
    """
    from nigemizu.air import Atmosphere

    atmosphere = Atmosphere()
    z = np.linspace(0.0, 100.0, 401)
    temperature = 276.0 + 9.0 / (1.0 + np.exp(-(z - 25.0) / 2.5))
    pressure = atmosphere.hydrostatic_pressure(z, temperature)
    refractivity = atmosphere.refractivity(temperature, pressure)
    # (1 + N) exp(z/R) − 1 without losing the digits of N
    flat = np.expm1(z / EARTH_RADIUS)
    return z, refractivity + flat + refractivity * flat


def stratified_seconds(
    size: tuple[int, int] = (960, 600),
    distance: float = DISTANCE,
    repeats: int = OFTEN,
    *,
    progress: ProgressMeter = SILENT,
) -> dict[str, Any]:
    """Time of the bent rays of a picture, one per pixel, through air that varies with height alone.

    Parameters
    ----------
    size : (int, int)
        Width and height of the picture in pixels.
    distance : float, m
        Length of the rays that do not meet the water.
    repeats : int
    progress : ProgressMeter

    Returns
    -------
    dict
        ``seconds``, ``rays`` (how many were marched: one per row in double precision, whose path serves all
        pixels of the row), ``pixels``, ``distance`` [m] and ``accuracy_radians``.
    """
    from nigemizu import field, trace

    types = field.types("llvm", "double")
    medium = stratified_field(*inversion(), types)
    width, height = size
    rise = np.arctan((np.arange(height) + 0.5 - 0.5 * height) * PIXEL)
    still = np.zeros_like(rise)
    origin = types.Array3f(np.stack([still, still, np.full_like(rise, EYE)]))
    direction = types.Array3f(np.stack([np.cos(rise), still, np.sin(rise)]))
    sea, controls = trace.ground_plane(0.0), control(ACCURACY)

    def march() -> Any:
        end = trace.march(medium, origin, direction, surface=sea, max_distance=distance, **controls)
        return settle(end)

    seconds = alternate({"rays": march}, repeats, label="40 km", progress=progress)["rays"]
    return {
        "seconds": seconds,
        "rays": height,
        "pixels": width * height,
        "distance": distance,
        "accuracy_radians": ACCURACY,
    }
