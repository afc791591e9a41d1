"""The sections of a scene, and what they have to agree on."""

from __future__ import annotations

from abc import ABC
from typing import Literal, NamedTuple, Self, final

from pydantic import model_validator

from nigemizu.air import Atmosphere, Earth, ProfileSpec
from nigemizu.errors import InputError
from nigemizu.heat.boundary import GroundBoundary, Sides, Top
from nigemizu.heat.flow.settings import Convection
from nigemizu.heat.flow.sources import Source
from nigemizu.heat.grid import GridSpec
from nigemizu.heat.initial import Initial
from nigemizu.heat.transport import Diffusivity, Wind
from nigemizu.heat.turbulence.settings import Turbulence
from nigemizu.render import Camera, Light, Object
from nigemizu.scene.times import FilmSpec, TimeSpec
from nigemizu.trace import Tracer
from nigemizu.values import Value

__all__ = ["Heated", "Sections"]


@final
class Heated(NamedTuple):
    """What has to be stated of air that is heated."""

    grid: GridSpec
    initial: Initial
    ground: GroundBoundary


class Sections(Value, ABC):
    """What a scene consists of; `nigemizu.scene.Scene` says what each is for."""

    title: str = ""
    description: str = ""
    air: Atmosphere = Atmosphere()
    earth: Earth | None = None
    profile: ProfileSpec | None = None
    grid: GridSpec | None = None
    initial: Initial | None = None
    ground: GroundBoundary | None = None
    sides: Sides = Sides()
    top: Top = Top()
    diffusivity: Diffusivity = Diffusivity()
    wind: Wind = Wind()
    process: Literal["diffusion", "convection"] = "diffusion"
    convection: Convection = Convection()
    sources: tuple[Source, ...] = ()
    turbulence: Turbulence | None = None
    time: TimeSpec = TimeSpec()
    film: FilmSpec = FilmSpec()
    tracer: Tracer = Tracer()
    camera: Camera = Camera()
    light: Light = Light()
    objects: tuple[Object, ...] = ()

    @model_validator(mode="after")
    def _picture_is_simulated(self) -> Self:
        if self.time.picture is not None and self.time.picture > self.time.duration:
            raise InputError(
                "lies after the simulated time",
                key="time.picture",
                value=self.time.picture,
                expected=f"at most time.duration, {self.time.duration:g} s",
            )
        return self

    @model_validator(mode="after")
    def _air_is_stated(self) -> Self:
        """Air comes from a mesh that is heated, from a profile, or from both."""
        parts = {"grid": self.grid, "initial": self.initial, "ground": self.ground}
        missing = [name for name, part in parts.items() if part is None]
        if missing and (self.profile is None or len(missing) < len(parts)):
            raise InputError(
                "is missing",
                key=missing[0],
                remedy="state [grid], [initial] and [ground] of air that is heated"
                + ("" if len(missing) < len(parts) else ", or a [profile] of air in layers"),
            )
        return self

    @property
    def round(self) -> bool:
        """Whether the Earth has a radius."""
        return self.earth is not None and not self.earth.flat

    @property
    def heated(self) -> Heated | None:
        """The mesh of the air that is heated, if there is any."""
        if self.grid is None or self.initial is None or self.ground is None:
            return None
        return Heated(self.grid, self.initial, self.ground)

    def require_heated(self) -> Heated:
        """The same, or an error that says what is wanting."""
        heated = self.heated
        if heated is None:
            raise InputError(
                "this scene has air in layers alone, nothing that is heated in time",
                key="grid",
                expected="[grid], [initial] and [ground]",
            )
        return heated
