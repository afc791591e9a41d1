"""The turbulence on a grid at any instant, from its seed and the time alone."""

from __future__ import annotations

import math
import os
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.fft import irfft2

from nigemizu.errors import InputError, NigemizuWarning
from nigemizu.heat.grid import Grid, require_memory
from nigemizu.heat.kernels import compiled, spread_groups
from nigemizu.heat.transport import Wind
from nigemizu.heat.turbulence.levels import Spectra, coherence_factor, covariance
from nigemizu.heat.turbulence.modes import find_modes, fold
from nigemizu.heat.turbulence.settings import Turbulence
from nigemizu.heat.turbulence.spectrum import outer_wave_number

__all__ = ["TurbulentField", "share"]

FACTORS_PER_OCTAVE: Final = 8
"""Vertical factors for each factor of two of the horizontal wave number; linear between."""

BANDS_PER_OCTAVE: Final = 4
"""Bands of modes with one lifetime, for each factor of two of the wave number."""

LARGEST_PART: Final = 2048
"""Modes that are drawn together, with one key of the random numbers."""

VOLUMES: Final = 6
"""Copies of the temperature volume held while an instant is computed."""

KEY: Final = 0x7B1E
"""First number of the key of every drawing, so that no other drawing with the same seed is the same."""

GOLDEN: Final = (math.sqrt(5.0) - 1.0) / 2.0

MEMORY: Final = 0.7323977682569475
"""Integral time scale of the mixture of epochs, in epochs: ½ (∫ share)²."""


def share(distance: float) -> float:
    """With which amplitude an epoch counts at a distance (in epochs) from its middle.

    The squares of neighbouring epochs add up to one, and the slope has no jump.
    """
    d = abs(distance)
    return math.cos(0.5 * math.pi * d * d * (3.0 - 2.0 * d)) if d < 1.0 else 0.0


@final
@dataclass(frozen=True)
class _Part:
    """Some modes of one band: what is needed to draw and to place them."""

    number: int
    folded: bool
    first: int
    last: int
    epoch: float  # s; infinite for frozen turbulence
    offset: float
    groups: tuple[np.ndarray, ...]  # of spread_groups, with the factors that are used
    factors: slice


@final
class TurbulentField:
    """Turbulent temperature fluctuations on the cells of a grid, at any time.

    Parameters
    ----------
    grid : Grid
        Uniform along x and y; any heights. Periodic along x and y.
    settings : Turbulence
    wind : Wind, optional
        Carries the eddies, every level with its own velocity; calm if left out.
    workers : int, optional
        Threads; as many as there are processors if left out. The result does not depend on them.

    Raises
    ------
    InputError
        When cells are larger than the largest eddies, or the volume does not fit into memory.

    Warns
    -----
    NigemizuWarning
        When the box is smaller than the outer scale, or eddies next to the ground are smaller than the cells.

    Notes
    -----
    T'(x, y, z_i, t) = Σ_q e^{i q·x} s_i(q) Σ_e w_e(t) e^{−i q·U_i (t − t_e)} Σ_j L_ij(q) g_j(q, e): waves q
    of the box; their amplitude s_i with the spectrum of `Turbulence`; the factor L of the vertical coherence
    (`nigemizu.heat.turbulence.levels`), so that differences between any two levels are those of real air;
    independent normal numbers g, drawn afresh for every epoch e; and the shift by the wind since the middle
    t_e of the epoch, exact for any part of a cell. Two epochs overlap at any time, with w² adding up
    to one. Nothing but the seed and t decides: instants may be computed in any order and by any process.

    Epochs are as long as the eddies of their wave number live, and never longer than half the time in
    which the fastest wind blows through the box, so that no eddy comes back: large eddies in a small box are
    renewed sooner than `eddy_lifetime` says. Without a lifetime there is one epoch, and the field does come
    back.

    The horizontal mean of every level is zero: what moves whole levels, and with them distant images up and
    down, is left out, 5 to 8 % of the variance of vertical image motion in a box that is an outer scale wide
    and 200 m long. Heights are points: a level has what the air has at the
    centre of its cells, all vertical wave numbers included. Along x and y the spectrum ends, sharply, at the
    Nyquist wave number of the cells, unless `unresolved` is ``"folded"``: integrals along a row of cells are
    those of the continuous air, so that long cells do not exaggerate the bending of light. Differences
    between near cells lack the eddies that have no room: in cubic cells, of C_T² r^(2/3), 28 % two cells
    apart, 18 % four cells apart, 13 % eight cells apart. What is folded, in the other case, has the right
    variance at every wave number and one vertical coherence, the mean of its own.

    Limits: the wind is a function of height and its own gusts do not carry the eddies. Where it changes with
    height it tilts the eddies of an epoch, and differences between levels grow by about (1 + S² τ²)^(5/6),
    S the shear and τ the lifetime of eddies as large as the distance between the levels. Under a logarithmic
    wind of 2 m/s at 2 m and the default lifetime the mean square difference is 1 to 2 % too large above half
    a metre, 6 % at 0.2 m, and 70 % at 4 cm (5 m/s: 4 %, 25 %, threefold). Shorter lifetimes lessen it; along
    x and y nothing changes. Vertical sections (one cell along x or y) have the statistics of a plane through
    three-dimensional air. One caller at a time.

    References
    ----------
    G. I. Taylor, Proc. R. Soc. Lond. A 164 (1938) 476, doi:10.1098/rspa.1938.0032: frozen turbulence.

    Examples
    --------
    >>> from nigemizu.heat import GridSpec, Wind
    >>> grid = GridSpec(x=(0, 8), y=(-2, 2), height=2.0, cells=(32, 16, 8)).build()
    >>> field = TurbulentField(grid, Turbulence(ct2=0.1, outer_scale=2.0), Wind(speed=2.0))
    >>> field.at(3600.0).shape
    (8, 16, 32)
    """

    def __init__(
        self, grid: Grid, settings: Turbulence, wind: Wind | None = None, *, workers: int | None = None
    ) -> None:
        require_memory(math.prod(grid.shape), volumes=VOLUMES)
        self.grid, self.settings = grid, settings
        self._workers = workers or os.cpu_count() or 1
        outer = settings.outer_scale_at(grid.z)
        _check_cells(grid, outer, settings.largest)

        k0 = np.atleast_1d(outer_wave_number(outer if np.ptp(outer) > 0 else outer[:1]))
        spectra = Spectra(k0, settings.inner_scale, settings.largest, 1 in grid.shape[1:])
        self._modes = modes = find_modes(grid, spectra)
        self._scale = np.sqrt(settings.structure_parameter(grid.z))
        self._velocity = (wind or Wind()).velocity(grid.z)
        self._powers = [modes.power]
        self._factors, places = self._make_factors(spectra)
        self._parts = self._divide(places)
        if settings.unresolved == "folded":
            power, between, typical = fold(grid, spectra, modes)
            self._powers.append(power)
            self._factors = np.concatenate([self._factors, coherence_factor(between)[None]])
            last = np.full(modes.middle.size, len(self._factors) - 1.0)
            self._parts += self._cut(0, modes.middle.size, self._epoch(typical), last, True)
        self._kept: dict[tuple[int, int], np.ndarray] = {}
        _warn(grid, outer, settings)

    @property
    def variance(self) -> np.ndarray:
        """Expected variance on every level, (nz,) float64, K²: what the cells hold of the spectrum."""
        return np.asarray(self._scale**2 * sum(2 * np.sum(power, axis=1) for power in self._powers))

    def lifetime(self, wave_number: float) -> float:
        """Integral time scale [s] of eddies of a horizontal wave number [m⁻¹]; in bands, within 6 %."""
        return MEMORY * self._epoch(wave_number)

    def at(self, time: float) -> np.ndarray:
        """The fluctuations at an instant.

        Parameters
        ----------
        time : float, s
            Any; also negative.

        Returns
        -------
        (nz, ny, nx) float64, K
            With a mean of zero on every level.
        """
        if not math.isfinite(time):
            raise InputError("an instant is a finite number of seconds", key="time", value=time)
        nz, ny, nx = self.grid.shape
        waves = np.zeros((nz, ny, nx // 2 + 1), dtype=np.complex128)
        kept: dict[tuple[int, int], np.ndarray] = {}
        with ThreadPoolExecutor(self._workers) as pool:
            # parts of one kind have no wave in common; the folded ones come on top of the others
            for folded in (False, True):
                parts = [part for part in self._parts if part.folded == folded]
                for used in pool.map(lambda part: self._add(part, time, waves), parts):
                    kept.update(used)
        self._kept = kept
        field = irfft2(waves, s=(ny, nx), norm="forward", overwrite_x=True, workers=self._workers)
        field *= self._scale[:, None, None]
        return np.asarray(field)

    def _epoch(self, wave_number: float) -> float:
        """Length of an epoch [s] at a wave number."""
        if self.settings.eddy_lifetime == "frozen":
            return math.inf
        length = self.settings.eddy_lifetime * (2 * math.pi / wave_number) ** (2 / 3) / MEMORY
        for speeds, step, cells in zip(
            self._velocity, (self._modes.step_x, self._modes.step_y), self.grid.shape[:0:-1], strict=True
        ):
            fastest = float(np.max(np.abs(speeds)))
            if cells > 1 and fastest > 1e-9:
                length = min(length, math.pi / step / fastest)
        return float(length)

    def _make_factors(self, spectra: Spectra) -> tuple[np.ndarray, np.ndarray]:
        """Vertical factors on a scale of wave numbers, and the place of every mode on it."""
        logarithm = np.log2(self._modes.typical)
        low, high = float(np.min(logarithm)), float(np.max(logarithm)) + 1e-9
        count = math.ceil((high - low) * FACTORS_PER_OCTAVE) + 1
        scale = 2.0 ** (low + np.arange(count + 1) / FACTORS_PER_OCTAVE)

        def make(q: float) -> np.ndarray:
            return coherence_factor(covariance(spectra, q, self._modes.table, self.grid.z))

        with ThreadPoolExecutor(self._workers) as pool:
            return np.array(list(pool.map(make, scale))), (logarithm - low) * FACTORS_PER_OCTAVE

    def _divide(self, places: np.ndarray) -> list[_Part]:
        """The modes in bands of one lifetime, and those in parts."""
        middle = self._modes.middle
        band = np.floor(BANDS_PER_OCTAVE * np.log2(middle / middle[0]) + 1e-9)
        starts = np.flatnonzero(np.diff(band, prepend=-1.0))
        parts: list[_Part] = []
        for start, end in zip(starts, [*starts[1:], middle.size], strict=True):
            centre = math.exp(float(np.mean(np.log(middle[start:end]))))
            parts += self._cut(int(start), int(end), self._epoch(centre), places, False, len(parts))
        return parts

    def _cut(
        self, start: int, end: int, epoch: float, places: np.ndarray, folded: bool, number: int | None = None
    ) -> list[_Part]:
        """Modes ``start … end - 1`` in parts, numbered from `number`."""
        number = len(self._parts) if number is None else number
        parts = []
        for first in range(start, end, LARGEST_PART):
            last = min(first + LARGEST_PART, end)
            groups, factors = _group(places[first:last], len(self._factors))
            offset = number * GOLDEN % 1.0
            parts.append(_Part(number, folded, first, last, epoch, offset, groups, factors))
            number += 1
        return parts

    def _add(self, part: _Part, time: float, waves: np.ndarray) -> list[tuple[tuple[int, int], np.ndarray]]:
        """Add the waves of one part; returns the amplitudes that were used, for the next instant."""
        if math.isinf(part.epoch):
            active = [(0, 1.0, time)]
        else:
            now = time / part.epoch + part.offset
            before = math.floor(now)
            active = [(e, share(now - e), (now - e) * part.epoch) for e in (before, before + 1)]
        used = []
        kx = self._modes.step_x * np.arange(waves.shape[2])
        ky = self._modes.step_y * np.fft.fftfreq(waves.shape[1], 1.0 / waves.shape[1])
        chosen = slice(part.first, part.last)
        top = int(np.max(self._modes.mx[chosen])) + 1
        for epoch, weight, passed in active:
            amplitudes = self._kept.get((part.number, epoch))
            if amplitudes is None:
                amplitudes = self._draw(part, epoch)
            used.append(((part.number, epoch), amplitudes))
            if weight == 0.0:
                continue
            turn_x = np.exp(-1j * np.outer(self._velocity[0] * passed, kx[:top]))
            turn_y = weight * np.exp(-1j * np.outer(self._velocity[1] * passed, ky))
            _place(waves, amplitudes, self._modes.mx[chosen], self._modes.my[chosen], turn_x, turn_y)
        return used

    def _draw(self, part: _Part, epoch: int) -> np.ndarray:
        """Amplitudes of one part in one epoch, (nz, modes) complex128."""
        key = (KEY, part.number, 2 * epoch if epoch >= 0 else -2 * epoch - 1)
        sequence = np.random.SeedSequence(self.settings.seed, spawn_key=key)
        noise = np.random.Generator(np.random.PCG64(sequence)).standard_normal(
            (self.grid.shape[0], 2 * (part.last - part.first))
        )
        factors = self._factors[part.factors]
        levels = noise.shape[0]
        begins = np.zeros((len(factors), levels), dtype=np.int64)
        ends = begins + np.arange(1, levels + 1)
        result = np.empty_like(noise)
        spread_groups(factors, begins, ends, *part.groups, noise, result, 0, noise.shape[1])
        amplitudes = result.view(np.complex128)
        amplitudes *= np.sqrt(0.5 * self._powers[int(part.folded)][:, part.first : part.last])
        return amplitudes


def _group(places: np.ndarray, available: int) -> tuple[tuple[np.ndarray, ...], slice]:
    """Modes sorted by the factors between which they lie, as `spread_groups` wants them.

    Linear between two factors; real and imaginary parts are columns of their own.
    """
    lower = np.floor(places).astype(np.int64)
    first = int(lower.min())
    count = min(int(lower.max()) + 2, available) - first
    columns = np.arange(2 * places.size)
    low, part = np.repeat(lower - first, 2), np.repeat(places - lower, 2)
    factor = np.concatenate([low, low + 1])
    both, weights = np.concatenate([columns, columns]), np.concatenate([1.0 - part, part])
    counted = np.flatnonzero(weights)
    order = counted[np.argsort(factor[counted], kind="stable")]
    firsts = np.searchsorted(factor[order], np.arange(count + 1))
    return (firsts, both[order], weights[order]), slice(first, first + count)


@compiled()
def _place(waves, amplitudes, mx, my, turn_x, turn_y):  # type: ignore[no-untyped-def]
    rows = waves.shape[1]
    for level in range(waves.shape[0]):
        for n in range(mx.size):
            column, row = mx[n], my[n] % rows
            value = amplitudes[level, n] * turn_x[level, column] * turn_y[level, row]
            waves[level, row, column] += value
            if column == 0:
                waves[level, rows - row, 0] += value.conjugate()


def _check_cells(grid: Grid, outer: np.ndarray, largest: float | None) -> None:
    reach = float(np.max(outer)) if largest is None else min(float(np.max(outer)), largest)
    name = "outer_scale" if largest is None or np.max(outer) < largest else "largest"
    cells = {axis: grid.horizontal_step(axis) for axis in "xy"}
    cells["z"] = float(np.min(grid.z_widths))
    counts = dict(zip("zyx", grid.shape, strict=True))
    if counts["x"] < 3 and counts["y"] < 3:
        raise InputError(
            "turbulence has no room in so few cells", key="grid.cells", expected="at least 3 along x or y"
        )
    for axis, width in cells.items():
        if counts[axis] > 1 and width > reach:
            raise InputError(
                f"cells of {width:.4g} m along {axis} are larger than the largest eddies of {reach:.4g} m",
                key=f"turbulence.{name}",
                expected=f"above {width:.4g} m",
                remedy="use more cells or a larger scale",
            )


def _warn(grid: Grid, outer: np.ndarray, settings: Turbulence) -> None:
    reach = outer if settings.largest is None else np.minimum(outer, settings.largest)
    sides = (("x", grid.x_edges), ("y", grid.y_edges))
    axes = [(axis, edges, grid.horizontal_step(axis)) for axis, edges in sides if edges.size > 2]
    for axis, edges, _ in axes:
        extent, wanted = float(edges[-1] - edges[0]), float(np.max(reach))
        if extent < wanted * (1 - 1e-9):
            warnings.warn(
                f"turbulence: the box is {extent:.4g} m long along {axis}, less than the outer scale of "
                f"{wanted:.4g} m; eddies above {extent:.4g} m do not vary along {axis}, and those above the "
                "box in both directions are missing",
                NigemizuWarning,
                stacklevel=3,
            )
    # Long cells lose nothing that bends light along them: the shorter side decides.
    width = min(step for _, _, step in axes)
    lost = np.flatnonzero(reach < width)
    if lost.size and settings.unresolved == "left out":
        warnings.warn(
            f"turbulence: below {float(grid.z_edges[lost[-1] + 1]):.4g} m above the ground all eddies are "
            f"smaller than the cells of {width:.4g} m, which hold next to nothing of them",
            NigemizuWarning,
            stacklevel=3,
        )
