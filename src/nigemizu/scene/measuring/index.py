"""The refractive index of a scene's layers, as the integrals of `nigemizu.trace` want it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Self, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.scene.far_air import FarAir

if TYPE_CHECKING:
    from nigemizu.scene.model import Scene

__all__ = ["PiecewiseIndex", "SceneIndex"]

FloatArray: TypeAlias = NDArray[np.float64]

_DEGREE: Final = 6
_NODES: Final = np.polynomial.chebyshev.chebpts2(_DEGREE + 1)
_TESTED: Final = 0.5 * (_NODES[1:] + _NODES[:-1])
_POWERS: Final = np.linalg.inv(np.vander(_NODES, increasing=True)).T
_ERROR: Final = 1e-15  # of n between the nodes, from which on a piece is halved …
_HALVINGS: Final = 8  # … so often at most
_KINK: Final = 1e-7  # of the slope, by which it jumps at a break
_LEAST_KINK: Final = 1e-16  # 1/m
_SHORTEST: Final = 1e-6  # m, of a piece
_SHORT_WAVE, _LONG_WAVE = 300e-9, 1700e-9  # m, for which the laws of refraction hold


@final
@dataclass(frozen=True)
class PiecewiseIndex:
    """n − 1 of one wavelength as polynomials between heights: continuous, with slopes that may jump.

    Attributes
    ----------
    edges : (N + 1,) float64, m
    powers : (N, 7) float64, 1
        Coefficients of the powers of the place in the piece, −1 at its lower edge and 1 at its upper.
    breaks : (B,) float64, m
        Edges at which the slope jumps.
    """

    edges: FloatArray
    powers: FloatArray
    breaks: FloatArray

    @classmethod
    def of(cls, excess: Callable[[FloatArray], FloatArray], edges: FloatArray) -> Self:
        """Interpolate n − 1 as a function of the height [m], in Chebyshev's points of each piece.

        Parameters
        ----------
        excess : callable
            n − 1 at heights [m]; smooth between the edges.
        edges : (N + 1,) float64, m
            Increasing. Pieces are halved where the polynomials err by more than 1e-15.
        """
        done: list[FloatArray] = []
        powers: list[FloatArray] = []
        low, high = edges[:-1], edges[1:]
        for halving in range(_HALVINGS + 1):
            middle, half = 0.5 * (low + high)[:, None], 0.5 * (high - low)[:, None]
            heights = middle + half * np.concatenate([_NODES, _TESTED])
            heights[:, [0, _DEGREE]] = np.stack([low, high], axis=1)
            values = excess(heights.ravel()).reshape(heights.shape)
            fitted = values[:, : _DEGREE + 1] @ _POWERS
            error = np.abs(np.polynomial.polynomial.polyval(_TESTED, fitted.T) - values[:, _DEGREE + 1 :])
            poor = (error.max(axis=1) > _ERROR) & (high - low > _SHORTEST)
            if halving == _HALVINGS:
                poor[:] = False
            done.append(np.stack([low, high], axis=1)[~poor])
            powers.append(fitted[~poor])
            low, high = (
                np.concatenate([low[poor], middle[poor, 0]]),
                np.concatenate([middle[poor, 0], high[poor]]),
            )
            if not low.size:
                break
        pieces, coefficients = np.concatenate(done), np.concatenate(powers)
        order = np.argsort(pieces[:, 0])
        ends = np.append(pieces[order, 0], edges[-1])
        made = cls(ends, coefficients[order], np.empty(0))
        return cls(ends, coefficients[order], made._kinks())

    def __call__(self, height: FloatArray, /) -> tuple[FloatArray, FloatArray]:
        """n − 1 and dn/dh [m⁻¹] at heights [m]; beyond the edges the outermost polynomials go on."""
        cell = np.clip(np.searchsorted(self.edges, height, side="right") - 1, 0, len(self.powers) - 1)
        return self._at(cell, height)

    def _at(self, cell: NDArray[np.intp], height: FloatArray) -> tuple[FloatArray, FloatArray]:
        low, per_half = self.edges[cell], 2.0 / (self.edges[cell + 1] - self.edges[cell])
        place = (height - low) * per_half - 1.0
        value, slope = np.zeros_like(place), np.zeros_like(place)
        for power in range(_DEGREE, -1, -1):
            slope = slope * place + value
            value = value * place + self.powers[cell, power]
        return value, slope * per_half

    def _kinks(self) -> FloatArray:
        inner, below = self.edges[1:-1], np.arange(len(self.powers) - 1)
        before, after = self._at(below, inner)[1], self._at(below + 1, inner)[1]
        size = np.abs(before) + np.abs(after)
        return inner[np.abs(after - before) > _KINK * size + _LEAST_KINK]


@final
@dataclass(frozen=True)
class SceneIndex:
    """n − 1 and dn/dh of the layers of a scene at K wavelengths, a `nigemizu.trace.RadialIndex`.

    Attributes
    ----------
    air : PiecewiseIndex
        At the wavelength of the scene.
    wavelengths : (K,) float64, m
    dispersion : (K,) float64, 1
        n − 1 at the wavelengths, in units of that of the scene's own.
    radius : float, m
        Of the Earth.
    ground, top : float, m
        Where rays end, and where the air does.
    """

    air: PiecewiseIndex
    wavelengths: FloatArray
    dispersion: FloatArray
    radius: float
    ground: float
    top: float

    @classmethod
    def of(cls, scene: Scene, wavelengths: Iterable[float] | None) -> Self:
        """The layers of a scene, for light of the wavelengths [m], or for that of the scene.

        Raises
        ------
        InputError
            It has no profile or a flat Earth; or a wavelength is out of range.
        """
        from nigemizu.render import Ground

        if scene.profile is None:
            raise InputError(
                "a table of refraction wants air in layers",
                key="profile",
                remedy='add a section [profile], for instance with kind = "us1976", and [earth]',
            )
        if not scene.round:
            raise InputError(
                "over a flat Earth there is neither a horizon nor refraction of stars",
                key="earth.flat",
                remedy="add a section [earth] without flat = true",
            )
        far = FarAir.of(scene)
        lengths = np.array([scene.air.wavelength] if wavelengths is None else list(wavelengths))
        fits = (lengths >= _SHORT_WAVE) & (lengths <= _LONG_WAVE)
        if not lengths.size or not np.all(fits):
            wrong = None if not lengths.size else float(lengths[np.argmax(~fits)])
            raise InputError(
                "no wavelength of light", key="wavelength", value=wrong, expected="metres, 300e-9 to 1.7e-6"
            )
        nodes = far.profile.nodes()
        air = PiecewiseIndex.of(lambda height: far.profile.refractivity(height, far.atmosphere), nodes)
        grounds = [entry.height for entry in scene.objects if isinstance(entry, Ground)]
        dispersion = np.array([far.dispersion(float(length)) for length in lengths])
        ground, top = max([float(nodes[0]), *grounds]), float(nodes[-1])
        return cls(air, lengths, dispersion, far.earth.radius, ground, top)

    @property
    def breaks(self) -> FloatArray:
        """(B,), m — heights at which dn/dh jumps."""
        return self.air.breaks

    def __call__(self, height: FloatArray, /) -> tuple[FloatArray, FloatArray]:
        """n − 1 and dn/dh [m⁻¹] at heights [m], with the wavelengths along the last axis."""
        excess, slope = self.air(np.asarray(height, dtype=np.float64))
        return excess * self.dispersion, slope * self.dispersion
