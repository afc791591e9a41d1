"""The refractive index of a scene's layers, as the integrals of `nigemizu.trace` want it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Self, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.scene.far_air import FarAir

if TYPE_CHECKING:
    from nigemizu.air import LayeredIndex
    from nigemizu.scene.model import Scene

__all__ = ["SceneIndex"]

FloatArray: TypeAlias = NDArray[np.float64]

_SHORTEST: Final = 300e-9  # m, for which the laws of refraction hold
_LONGEST: Final = 1700e-9
_COLOURLESS: Final = ("gladstone-dale", "lehn1978")


@final
@dataclass(frozen=True)
class SceneIndex:
    """n − 1 and dn/dh of the layers of a scene at K wavelengths: a `nigemizu.trace.RadialIndex`.

    Attributes
    ----------
    law : LayeredIndex
        For the K wavelengths.
    wavelengths : (K,) float64, m
    radius : float, m
        Of the Earth.
    ground, top : float, m
        Where rays end, and where the air does.
    """

    law: LayeredIndex
    wavelengths: FloatArray
    radius: float
    ground: float
    top: float

    @classmethod
    def of(cls, scene: Scene, wavelengths: Iterable[float] | None) -> Self:
        """The layers of a scene, for light of the wavelengths [m], or for that of the scene.

        Raises
        ------
        InputError
            It has no profile or a flat Earth; a wavelength is out of range, or the law knows no colours.
        """
        from nigemizu.render import Ground

        if scene.profile is None:
            raise InputError(
                "this table wants air in layers",
                key="profile",
                remedy='add a section [profile], for instance with kind = "us1976", and [earth]',
            )
        if not scene.round:
            raise InputError(
                "over a flat Earth there is neither a horizon nor refraction of stars",
                key="earth.flat",
                remedy="add a section [earth] without flat = true",
            )
        lengths = np.array([scene.air.wavelength] if wavelengths is None else list(wavelengths))
        fits = (lengths >= _SHORTEST) & (lengths <= _LONGEST)
        if not lengths.size or not np.all(fits):
            wrong = None if not lengths.size else float(lengths[np.argmin(fits)])
            raise InputError(
                "no wavelength of light", key="wavelength", value=wrong, expected="metres, 300e-9 to 1.7e-6"
            )
        if scene.air.model in _COLOURLESS and not np.all(lengths == scene.air.wavelength):
            raise InputError(
                "this law of refraction is the same for all colours",
                key="air.model",
                value=scene.air.model,
                remedy="take ciddor1996, or ask for air.wavelength alone",
            )
        far = FarAir.of(scene)
        grounds = [entry.height for entry in scene.objects if isinstance(entry, Ground)]
        ground = max([far.profile.base, *grounds])
        law = far.profile.index(far.atmosphere, lengths)
        return cls(law, lengths, far.earth.radius, ground, far.profile.top)

    @property
    def breaks(self) -> FloatArray:
        """(B,), m — heights at which dn/dh jumps."""
        return self.law.breaks

    def __call__(self, height: FloatArray, /) -> tuple[FloatArray, FloatArray]:
        """n − 1 and dn/dh [m⁻¹] at heights [m], with the wavelengths along the last axis."""
        excess, slope = self.law(height)
        # A law without dispersion does not have that axis.
        each = np.ones(len(self.wavelengths))
        return excess * each, slope * each

    def limits(self) -> dict[str, Any]:
        """The arguments that all integrals have in common."""
        return {"radius": self.radius, "ground": self.ground}
