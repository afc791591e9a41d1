"""Marched rays for the page about refraction: in the standard air, over asphalt, and those of pictures."""

from __future__ import annotations

import numpy as np

from generators.validation import Case
from nigemizu import field
from nigemizu.air import Atmosphere
from nigemizu.scene import Scene
from nigemizu.scene.measuring.transfer_rays import flight_through

__all__ = ["cases", "marched"]

RADIUS = 6_371_000.0
ASPHALT = {
    2: 0.9092409349804159,
    4: 0.6189739252595535,
    6: 0.3336197571947891,
    8: 0.09430189437829967,
    10: 0.06417386919454562,
}
"""Height [m] at 500 m of rays that leave the eye so many arc minutes downwards."""


def marched(apparent: np.ndarray, law: Atmosphere, above: float) -> np.ndarray:
    """Refraction [rad] of rays that go up from the ground in the U.S. standard air.

    Parameters
    ----------
    apparent : (n,) float, degree
    law : nigemizu.air.Atmosphere
    above : float, 1
        n − 1 of the air at the top, 86 km, from where the rays go on into the vacuum.
    """
    scene = Scene.from_toml(
        f"""
        [earth]
        radius = {RADIUS}
        [profile]
        kind = "us1976"
        [air]
        model = "gladstone-dale"
        gladstone_dale_constant = {law.gladstone_dale_constant!r}
        wavelength = {law.wavelength!r}
        [tracer]
        method = "bent"
        accuracy = 1e-12
        accuracy_unit = "radian"
        [camera]
        eye = [0.0, 0.0, 1e-3]
        """
    )
    rays = scene.trace(apparent, paths=False)
    if set(rays.status) != {"escaped"}:
        raise AssertionError(f"rays do not leave the air: {rays.status}")
    distance = np.hypot(rays.end[:, 0], rays.end[:, 1])
    leaving = np.arcsin(rays.end_direction[:, 2])
    return np.asarray(np.radians(apparent) - (leaving - distance / RADIUS) + above / np.tan(leaving))


def cases() -> list[Case]:
    return [*_asphalt(), *_pictures()]


def _asphalt() -> list[Case]:
    """T = 308.168 K + 6.37 K exp(−10.08 z/m) over a plane, seen from 1.2 m."""
    air = field.ExponentialTemperature(field.types("llvm", "double"))
    tolerance = 1e-6
    flight = flight_through(air, (0.0, 0.0, 1.2), distance=500.0, tolerance=tolerance)
    heights = flight(np.radians(-np.array(list(ASPHALT)) / 60.0)).height
    source = "Horváth et al.'s air, two programs"
    return [
        Case(
            f"height at 500 m over asphalt, of a ray {down}′ down",
            source,
            expected,
            float(height),
            tolerance,
            unit="m",
        )
        for (down, expected), height in zip(ASPHALT.items(), heights, strict=True)
        if down in (2, 8, 10)
    ]


def _pictures() -> list[Case]:
    found = []
    for name in ("sunset-mock", "sunset-inferior"):
        strip = {"width": 16, "height": 540, "field_of_view": 16 / 960, "samples": 1}
        changes = {f"camera.{key}": value for key, value in strip.items()}
        picture = Scene.load(name, {**changes, "light.sky": "sunsky", "light.sun_elevation": 40.0}).render()
        if picture.report is None:
            raise AssertionError("a picture without a report")
        what = f"worst of 1024 rays of a picture, single precision; strip of {name}"
        source = "double precision, fifty times as exact"
        found.append(Case(what, source, 0.0, picture.report.worst, 0.1, unit="pixel"))
    return found
