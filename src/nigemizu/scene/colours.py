"""The wavelengths of a physical sky, and what each of them shows."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Self, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import NigemizuWarning

if TYPE_CHECKING:
    from nigemizu.render import Light, Moon
    from nigemizu.render.firmament import Firmament
    from nigemizu.render.heavens import Disc
    from nigemizu.render.sky import Sky
    from nigemizu.render.spectrum import Bands
    from nigemizu.scene.far_air import FarAir
    from nigemizu.scene.model import Scene
    from nigemizu.scene.running import AirVolume

__all__ = ["Colours"]

FloatArray = NDArray[np.float64]

_RINGS: Final = 256  # steps from the middle of a disc to its limb
_MARGIN: Final = 1e-7  # rad, by which the tables begin above the horizon
_FLAT: Final = 1e11  # m, radius of a flat Earth
_SEA: Final = 0.06  # albedo of the ground under the sky


@final
@dataclass(frozen=True)
class Colours:
    """Sun, Moon, sky and air of a scene at one time, wavelength by wavelength.

    Parameters
    ----------
    light : Light
    bands : Bands
    firmament : Firmament
        On the nodes of `nigemizu.render.heavens`.
    low : float, rad
        The lowest of these elevations.
    index : (K, 2) float64
        n′ at the eye and at the top of the air.
    haze : (K, 2) float64, 1/m
        Extinction at height 0 by molecules and by aerosol.
    scales : (float, float), m
        Heights over which these fall to 1/e.
    """

    light: Light
    bands: Bands
    firmament: Firmament
    low: float
    index: FloatArray
    haze: FloatArray
    scales: tuple[float, float]

    @classmethod
    def of(cls, scene: Scene, far: FarAir, light: Light, eye: float) -> Self:
        """What is seen from an eye at a conformal height [m]."""
        from nigemizu.render.firmament import azimuth_nodes, firmament
        from nigemizu.render.heavens import COLUMNS, elevation_nodes
        from nigemizu.render.spectrum import bands

        chosen = bands(light.wavelengths)
        heights = far.profile.nodes()
        temperature, pressure, _ = far.profile.at(heights)
        z = far.earth.conformal_height(heights)
        bare = far.profile.refractivity(heights, far.atmosphere, chosen.wavelength).T
        bare = np.broadcast_to(bare, (len(chosen), len(z)))  # laws without colours have one row
        if scene.tracer.method == "straight":
            bare = np.zeros_like(bare)
        index = (1 + bare) * far.earth.stretch(z)
        coefficients = light.extinction.coefficients(heights, temperature, pressure, chosen.wavelength)
        at_eye = np.array([np.interp(eye, z, row) for row in index])
        # The horizon: the ray that grazes the ground, or where n′ is least below the eye.
        least = np.minimum(index[:, z <= eye].min(axis=1), at_eye)
        low = -float(np.arccos(least / at_eye).min()) + _MARGIN
        made = firmament(
            z,
            index,
            coefficients,
            radius=_FLAT if far.earth.flat else far.earth.radius,
            eye=eye,
            sun_elevation=math.radians(light.sun_elevation),
            air=light.extinction,
            ground_albedo=_SEA,
            elevation=elevation_nodes(low),
            azimuth=azimuth_nodes(COLUMNS),
        )
        fall = int(np.argmax(pressure < pressure[0] / math.e))
        colours = cls(
            light=light,
            bands=chosen,
            firmament=_filled(made),
            low=low,
            index=np.stack([at_eye, index[:, -1]], axis=1),
            haze=np.stack([coefficients.rayleigh[:, 0], coefficients.aerosol[:, 0]], axis=1),
            scales=(float(heights[fall]), light.extinction.aerosol_height),
        )
        colours._warn_of_hidden_sun()
        return colours

    def __len__(self) -> int:
        return len(self.bands.wavelength)

    def wavelength(self, band: int) -> float:
        """Of a band [m]."""
        return float(self.bands.wavelength[band])

    def heavens(self, band: int, air: AirVolume | None) -> Any:
        """What a band shows beyond the air, on the device."""
        from nigemizu.render.heavens import Heavens

        layered = air is None or air.refractivity[0].size == 1
        count = len(self)
        return Heavens(
            low=self.low,
            sky=self.firmament.radiance[band],
            transmission=self.firmament.transmission[band],
            bodies=tuple(self._bodies(band)),
            sun_azimuth=math.radians(self.light.sun_azimuth),
            # A picture is the mean of its bands.
            colour=self.bands.to_rgb[band] * count,
            mixing=self.bands.mixing[band] * count,
            extinction=tuple(zip(self.haze[band].tolist(), self.scales, strict=True)),
            index=None if layered else (float(self.index[band, 0]), float(self.index[band, 1])),
        )

    @property
    def sky(self) -> Sky:
        """The light of Sun and sky that falls on objects."""
        from nigemizu.render.sky import baked_table
        from nigemizu.render.spectrum import into_gamut

        table = into_gamut(np.einsum("kea,kc->eac", self.firmament.radiance, self.bands.to_rgb))
        apparent, clear = self._sunlight()
        irradiance = into_gamut(math.pi * np.einsum("k,kc->c", clear, self.bands.to_rgb))
        azimuth = math.radians(self.light.sun_azimuth)
        towards = _direction(azimuth, max(apparent, 1e-3))
        return baked_table(table, self.firmament.elevation, azimuth, towards, irradiance)

    def _sunlight(self) -> tuple[float, FloatArray]:
        """Apparent elevation [rad] of the Sun, and the part of the light of its disc that arrives, (K,)."""
        from nigemizu.render.sun import SUN_RADIUS

        true, clear = self.firmament.true_elevation, self.firmament.transmission
        part = np.linspace(-0.95, 0.95, 15)
        weight = np.sqrt(1 - part**2)
        places = math.radians(self.light.sun_elevation) + part * SUN_RADIUS
        arrived = np.array(
            [
                np.average(np.interp(places, *_rising(rows, through), left=0.0), weights=weight)
                for rows, through in zip(true, clear, strict=True)
            ]
        )
        middle = len(self) // 2
        known = np.isfinite(true[middle])
        apparent = np.interp(
            math.radians(self.light.sun_elevation),
            *_rising(true[middle], np.where(known, self.firmament.elevation, np.nan)),
        )
        return float(apparent), arrived

    def _bodies(self, band: int) -> list[Disc]:
        from nigemizu.render.heavens import Disc
        from nigemizu.render.sun import SUN_RADIUS, moon_radiance, sun_radiance

        wavelength = self.wavelength(band)
        radiance = sun_radiance(np.linspace(0, 1, _RINGS), wavelength)[0]
        azimuth, elevation = (
            math.radians(part) for part in (self.light.sun_azimuth, self.light.sun_elevation)
        )
        found = [Disc(_direction(azimuth, elevation), SUN_RADIUS, radiance)]
        if self.light.moon is not None:
            moon = self.light.moon
            bright = np.full(_RINGS, float(moon_radiance(wavelength, math.radians(moon.phase_angle))))
            towards = _direction(math.radians(moon.azimuth), math.radians(moon.elevation))
            found.append(Disc(towards, math.radians(moon.diameter / 2), bright, _lit(moon, towards)))
        return found

    def _warn_of_hidden_sun(self) -> None:
        from nigemizu.render.sun import SUN_RADIUS

        true = self.firmament.true_elevation[len(self) // 2]
        lowest = float(np.nanmin(true))
        below = lowest - math.radians(self.light.sun_elevation) - SUN_RADIUS
        if below > 0 and self.light.moon is None:
            warnings.warn(
                f"light.sun_elevation: at {self.light.sun_elevation:g} degrees all of the Sun is "
                f"{math.degrees(below):.2f} degrees below the visible horizon, where one sees what stands "
                f"higher than {math.degrees(lowest):.2f} degrees; the picture is of twilight",
                NigemizuWarning,
                stacklevel=5,
            )


def _filled(made: Firmament) -> Firmament:
    """The same where the lowest rays, of which some meet the ground, are as the next one that does not."""
    parts = [made.radiance.copy(), made.transmission.copy(), made.true_elevation.copy()]
    for band, clear in enumerate(made.transmission):
        first = int(np.argmax(clear > 0))
        for part in parts:
            part[band, :first] = part[band, first]
    return replace(made, radiance=parts[0], transmission=parts[1], true_elevation=parts[2])


def _rising(true: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """True elevations in increasing order, with what belongs to them."""
    known = np.isfinite(true) & np.isfinite(values)
    order = np.argsort(true[known])
    return true[known][order], values[known][order]


def _direction(azimuth: float, elevation: float) -> FloatArray:
    flat = math.cos(elevation)
    return np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])


def _lit(moon: Moon, towards: FloatArray) -> FloatArray:
    """Unit vector from the Moon to the Sun, by the phase and the side that is lit."""
    right = np.array([towards[1], -towards[0], 0.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, towards)
    side = math.radians(moon.lit_side)
    across = math.cos(side) * up + math.sin(side) * right
    phase = math.radians(moon.phase_angle)
    return np.asarray(math.sin(phase) * across - math.cos(phase) * towards)
