"""Air in layers over a round Earth: alone, or above and beyond the mesh of air that is heated."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Self, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.air import Atmosphere, Earth, Profile, refractivity
from nigemizu.errors import InputError, NigemizuWarning

if TYPE_CHECKING:
    from nigemizu.scene.model import Scene
    from nigemizu.scene.running import AirVolume

__all__ = ["FarAir", "medium", "natural"]

FloatArray = NDArray[np.float64]

_REACH: Final = 3e6  # m beyond the mesh over which its horizontal mean goes on
_JOIN: Final = 3e-6  # by how much mesh and layers may differ where they meet: 3 K
_PER_KELVIN: Final = 0.9e-6  # of refractivity, near the ground
_APART: Final = 0.5  # of the mesh's uppermost cell, to the first layer above it
_NEAR: Final = 1.0  # m, below which nodes are thinned,
_CLOSEST: Final = 0.04  # to so many of their heights: slopes of a logarithm are then right to some 1e-6
_VACUUM_NODES: Final = 400


@final
@dataclass(frozen=True)
class FarAir:
    """The layers of a scene, as volumes of n′ on conformal heights (`nigemizu.air.Earth`).

    Parameters
    ----------
    profile : Profile
    earth : Earth
    atmosphere : Atmosphere
        Law of refraction, and the wavelength that is meant where none is said.
    """

    profile: Profile
    earth: Earth
    atmosphere: Atmosphere

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """The layers of the scene, read and checked.

        Raises
        ------
        InputError
            If it has none, or they cannot be used.
        """
        if scene.profile is None:
            raise InputError("this scene has no air in layers", key="profile", expected="a section [profile]")
        measured = None
        if scene.profile.file is not None:
            from nigemizu.heat import read_sounding

            measured = read_sounding(scene.profile.file)
        earth = scene.earth or Earth(flat=True)
        profile = scene.profile.build(earth, measured)
        _require_reach(scene, profile)
        return cls(profile, earth, scene.air)

    def alone(self) -> AirVolume:
        """Air that is all in layers."""
        heights = _thinned(self.profile.nodes(), self.profile.breaks)
        bent = self.profile.refractivity(heights, self.atmosphere)
        return self._volume(heights, bent, self.profile.at(heights)[0])

    def vacuum(self) -> AirVolume:
        """No air at all: light is straight, and the ground falls away below it."""
        heights = np.linspace(self.profile.height[0], self.profile.height[-1], _VACUUM_NODES)
        return self._volume(heights, np.zeros_like(heights), None)

    def around(self, near: AirVolume) -> AirVolume:
        """The mesh's air with the layers above it.

        Notes
        -----
        Where mesh and layers meet, the difference of their refractivities is taken up by the layers and fades
        with the height of the mesh: n does not jump, and far above the profile is what it was.

        Warns
        -----
        NigemizuWarning
            If they differ by more than 3 K do.
        """
        top = float(near.z[-1])
        heights = self.profile.nodes()
        above = heights[heights > top + _APART * float(near.z[-1] - near.z[-2])]
        ends = near.refractivity[-1].astype(np.float64)
        join = float(self.profile.refractivity(np.array([top]), self.atmosphere)[0])
        apart = float(ends.mean()) - join
        if abs(apart) > _JOIN:
            warnings.warn(
                f"profile: at the top of the mesh, {top:g} m, n of the layers is {apart / 1e-6:+.1f}e-6 away "
                f"from that of the mesh, some {abs(apart) / _PER_KELVIN:.0f} K; give both the same "
                "temperature and air.surface_pressure there",
                NigemizuWarning,
                stacklevel=4,
            )
        fading = np.exp(-(above - top) / top)[:, None, None]
        aloft = self.profile.refractivity(above, self.atmosphere)[:, None, None] + fading * (ends - join)
        z = self.earth.conformal_height(np.concatenate([near.z, above]))
        mapped = _mapped(np.concatenate([near.refractivity, aloft]), self._stretch(z))
        temperature = None
        if near.temperature is not None:
            temperature = np.concatenate([near.temperature, self.profile.at(above)[0]])
        return near._replace(z=z, refractivity=mapped, temperature=temperature)

    def dispersion(self, wavelength: float) -> float:
        """n − 1 for light of another wavelength [m], in units of that for the atmosphere's own."""
        lowest = (self.profile.temperature[0], self.profile.pressure[0])
        state: dict[str, Any] = {
            "vapour_fraction": self.profile.vapour_fraction[0],
            "co2_fraction": self.atmosphere.co2_fraction,
            "model": self.atmosphere.model,
            "gladstone_dale_constant": self.atmosphere.gladstone_dale_constant,
        }
        there, here = (
            float(refractivity(*lowest, wavelength=length, **state))
            for length in (wavelength, self.atmosphere.wavelength)
        )
        return there / here

    def at_wavelength(self, air: AirVolume, wavelength: float) -> AirVolume:
        """The same air for light of another wavelength [m].

        Notes
        -----
        n − 1 is taken as proportional to its value in the lowest layer: exact for air of one composition.
        """
        stretch = self._stretch(air.z)
        bare = (air.refractivity + 1 - stretch) / stretch
        return air._replace(refractivity=_mapped(bare * self.dispersion(wavelength), stretch))

    def _volume(self, heights: FloatArray, bare: FloatArray, temperature: FloatArray | None) -> AirVolume:
        from nigemizu.scene.running import AirVolume

        z, place = self.earth.conformal_height(heights), np.zeros(1)
        mapped = _mapped(bare[:, None, None], self._stretch(z))
        return AirVolume(place, place, z, mapped, temperature)

    def _stretch(self, z: FloatArray) -> FloatArray:
        return self.earth.stretch(z)[:, None, None]


def _thinned(heights: FloatArray, breaks: FloatArray) -> FloatArray:
    """Nodes near the ground no closer than a part of their height: each costs grazing rays a step."""
    kept = [float(heights[0])]
    for height in heights[1:]:
        if height - kept[-1] >= _CLOSEST * height or height > _NEAR or height in breaks:
            kept.append(float(height))
    return np.array(kept)


def _require_reach(scene: Scene, profile: Profile) -> None:
    """Refuse data that end below the eye or below what is looked at."""
    places = [("camera.eye", scene.camera.eye[2])]
    for number, entry in enumerate(scene.objects):
        low = getattr(entry, "base", None)
        if not isinstance(low, float) or entry.kind == "pyramid":
            low = getattr(entry, "position", (0.0, 0.0, 0.0))[2]
        tall = getattr(entry, "height", getattr(entry, "radius", getattr(entry, "size", (0.0, 0.0, 0.0))[2]))
        places.append((f"objects.{number}", low + tall if entry.kind != "ground" else tall))
    for key, height in places:
        if height > profile.measured_top:
            raise InputError(
                f"the profile ends at {profile.measured_top:g} m, below what is {height:g} m high",
                key="profile",
                value=key,
                expected=f"levels up to {height:g} m",
                remedy="add a level, or lower what is looked at",
            )


def natural(scene: Scene, air: AirVolume) -> tuple[FloatArray, FloatArray]:
    """Heights [m] of a volume's nodes, and n − 1 there, without the map."""
    if scene.earth is None:
        return air.z, air.refractivity
    stretch = scene.earth.stretch(air.z)[:, None, None]
    return scene.earth.height(air.z), (air.refractivity + 1 - stretch) / stretch


def medium(scene: Scene, air: AirVolume, **options: Any) -> Any:
    """The volume on the device, for the scene's tracer; options as of `nigemizu.render.medium_of`."""
    from nigemizu.render import medium_of

    tracer = scene.tracer
    if scene.profile is not None:
        # Layers have no sides. Straight light over a round Earth is bent in the map.
        beyond = "extend" if air.refractivity[0].size == 1 else "mean"
        method = "bent" if tracer.method == "straight" else tracer.method
        tracer = tracer.model_copy(update={"beyond": beyond, "method": method})
        options["reach"] = _REACH
    return medium_of(*air[:4], tracer=tracer, **options)


def _mapped(bare: Any, stretch: Any) -> Any:
    """n′ − 1 of n − 1, without losing its digits."""
    return bare * stretch + (stretch - 1)
