"""Air as a stack of panes of constant index: the baseline method of Berger, Trout and Levit."""

from __future__ import annotations

from typing import Any, Final, Literal, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from nigemizu.errors import InputError
from nigemizu.field.types import Types

__all__ = ["Layers"]

WAVES: Final = 12  # sine waves that make up the waviness of a boundary


@final
class Layers:
    """Horizontal panes of constant index with wavy boundaries.

    Parameters
    ----------
    boundaries : (m,) array_like, m
        Heights of the boundaries, strictly increasing.
    refractivities : (m + 1,) array_like, 1
        n − 1 below the lowest boundary, between them from below upwards, and above the highest.
    types : Types
    waviness_amplitude : float, m
        Root mean square height of the waves. They tilt the normals at which light is refracted; the
        boundaries themselves stay flat.
    waviness_length : float, m
        Middle wavelength; the waves have between half and twice this length.
    waviness_seed : int
    waviness_drift : (2,) tuple of float, m
        How far the waves have been carried in x and y: a wind's velocity times the time.

    Notes
    -----
    The height of the waves is a sum of sines of random direction, wavelength and phase, with phases that
    differ from boundary to boundary.

    References
    ----------
    M. Berger, T. Trout, N. Levit (1990), Ray tracing mirages, IEEE Computer Graphics and Applications
    10(3), 36–41, doi:10.1109/38.55151.
    """

    def __init__(
        self,
        boundaries: ArrayLike,
        refractivities: ArrayLike,
        types: Types,
        waviness_amplitude: float = 0.0,
        waviness_length: float = 1.0,
        waviness_seed: int = 0,
        waviness_drift: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        heights = np.asarray(boundaries, dtype=np.float64)
        panes = np.asarray(refractivities, dtype=np.float64)
        if heights.ndim != 1 or heights.size < 1 or panes.shape != (heights.size + 1,):
            raise InputError(
                "boundaries and panes do not fit",
                key="refractivities",
                value=panes.shape,
                expected="one pane more than boundaries, at least one boundary",
            )
        if not (np.all(np.isfinite(heights)) and np.all(np.isfinite(panes)) and np.all(np.diff(heights) > 0)):
            raise InputError("the boundaries do not increase, or values are not finite", key="boundaries")
        if waviness_amplitude < 0 or waviness_length <= 0:
            raise InputError("the waviness needs an amplitude ≥ 0 and a length > 0", key="waviness")
        self.types = types
        self.count = int(heights.size)
        self.lowest = float(heights[0])
        self.highest = float(heights[-1])
        self._heights = types.Float(heights)
        self._indices = types.Float(1 + panes)
        # (n_t² − n_i²)/n_t² from n − 1, before it is stored: 1 − (n_i/n_t)² would lose its digits.
        squares = panes * (2 + panes)
        step = np.diff(squares)
        self._upward = types.Float(step / (1 + squares[1:]))
        self._downward = types.Float(-step / (1 + squares[:-1]))
        self._waves = _waves(waviness_amplitude, waviness_length, waviness_seed, waviness_drift)

    @classmethod
    def from_profile(
        cls,
        z: ArrayLike,
        refractivity: ArrayLike,
        count: int,
        types: Types,
        *,
        spacing: Literal["equal-index", "equal-height"] = "equal-index",
        **waviness: Any,
    ) -> Layers:
        """Cut a vertical profile into panes.

        Parameters
        ----------
        z : (m,) array_like, m
            Increasing heights; the panes fill the range between the first and the last.
        refractivity : (m,) array_like, 1
            n − 1, linear in between.
        count : int
            Number of panes, at least 2.
        types : Types
        spacing : {"equal-index", "equal-height"}
            Panes over which the index changes by equal amounts, or of equal thickness.
        **waviness
            ``waviness_amplitude`` and so on, as in `Layers`.

        Notes
        -----
        The boundaries are the inner ones: the lowest pane goes on downwards and the highest upwards. A
        pane takes the index of its middle (in height, or in index).
        """
        heights, profile = np.asarray(z, dtype=np.float64), np.asarray(refractivity, dtype=np.float64)
        if heights.ndim != 1 or heights.shape != profile.shape or heights.size < 2:
            raise InputError("the profile needs two heights or more", key="refractivity", value=profile.shape)
        if count < 2:
            raise InputError("too few panes", key="layers", value=count, expected="at least 2")
        if spacing not in ("equal-index", "equal-height"):
            raise InputError(
                "no such spacing", key="spacing", value=spacing, expected="equal-index or equal-height"
            )
        measure = heights
        if spacing == "equal-index":
            # Total variation, so that a profile that rises and falls is cut everywhere; the small share of
            # height keeps the measure increasing where the air is uniform.
            variation = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(profile)))])
            share = max(variation[-1], np.finfo(float).tiny) * 1e-9 / (heights[-1] - heights[0])
            measure = variation + share * (heights - heights[0])
        marks = np.linspace(measure[0], measure[-1], 2 * count + 1)
        cuts = np.interp(marks, measure, heights)
        return cls(cuts[2:-1:2], np.interp(cuts[1::2], heights, profile), types, **waviness)

    def boundary_height(self, boundary: Any, active: Any = True) -> Any:
        """Height of a boundary (Float, m) by its number from below (UInt32)."""
        return dr.gather(self.types.Float, self._heights, boundary, active)

    def index(self, pane: Any, active: Any = True) -> Any:
        """Refractive index (Float, 1) of a pane by its number from below (UInt32)."""
        return dr.gather(self.types.Float, self._indices, pane, active)

    def contrast(self, boundary: Any, upward: Any, active: Any = True) -> Any:
        """(n_t² − n_i²)/n_t² of a boundary for light that goes up or down through it (Float, 1)."""
        up = dr.gather(self.types.Float, self._upward, boundary, active)
        down = dr.gather(self.types.Float, self._downward, boundary, active)
        return dr.select(upward, up, down)

    def pane_at(self, height: Any) -> Any:
        """Number of the pane at a height (UInt32): how many boundaries lie at or below it."""
        types = self.types
        pane = types.UInt32(0)
        for bit in reversed(range(self.count.bit_length())):
            # Binary search by powers of two: the boundary with this number is counted if it lies below.
            next_pane = pane + (1 << bit)
            exists = next_pane <= self.count
            below = dr.gather(types.Float, self._heights, next_pane - 1, exists) <= height
            pane = dr.select(exists & below, next_pane, pane)
        return pane

    def normal(self, boundary: Any, position: Any) -> Any:
        """Upward unit normal of a boundary (Array3f, 1) at a position (Array3f, m)."""
        types = self.types
        if not self._waves:
            return types.Array3f(0, 0, 1)
        phase = types.Float(boundary)
        slope_x, slope_y = types.Float(0), types.Float(0)
        for amplitude, kx, ky, shift, turn in self._waves:
            slope = amplitude * dr.cos(kx * position.x + ky * position.y + shift + turn * phase)
            slope_x += kx * slope
            slope_y += ky * slope
        return dr.normalize(types.Array3f(-slope_x, -slope_y, 1))


def _waves(
    amplitude: float, length: float, seed: int, drift: tuple[float, float]
) -> tuple[tuple[float, float, float, float, float], ...]:
    """Amplitude [m], wave vector [1/m], phase and its change per boundary, of each sine."""
    if amplitude == 0:
        return ()
    random = np.random.default_rng(np.random.SeedSequence(seed))
    wavelength = length * 2.0 ** random.uniform(-1, 1, WAVES)
    angle = random.uniform(0, 2 * np.pi, WAVES)
    kx, ky = (2 * np.pi / wavelength) * np.stack([np.cos(angle), np.sin(angle)])
    shift = random.uniform(0, 2 * np.pi, WAVES) - kx * drift[0] - ky * drift[1]
    turn = random.uniform(0, 2 * np.pi, WAVES)
    each = np.full(WAVES, amplitude * np.sqrt(2 / WAVES))
    columns = np.stack([each, kx, ky, shift, turn], axis=1).tolist()
    return tuple((a, x, y, s, t) for a, x, y, s, t in columns)
