"""The temperature at the beginning: a profile, a dataset, and unevenness on top."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Final, Self, final

import numpy as np
from pydantic import Field, model_validator

from nigemizu.errors import InputError
from nigemizu.heat.formula import check_formula, evaluate_formula
from nigemizu.heat.grid import Grid, require_memory
from nigemizu.heat.measures import Kelvin, KelvinDifference, Metres, Seconds
from nigemizu.memory import available_memory
from nigemizu.values import Value

__all__ = ["Initial", "ProfileTable", "Unevenness"]

SPECTRUM_END: Final = 5.0
"""Wave number times correlation length beyond which the spectrum, exp(-k² l²), is below 2e-11 of its peak."""

LATTICE: Final = 0.5
"""Spacing of the vertical noise lattice in correlation lengths; the sum then equals the integral to 1e-8."""

REACH: Final = 11
"""Points of that lattice beyond a height that still count there: the weight of the next one is 2e-16."""


@final
class Unevenness(Value):
    """Reproducible unevenness of the air: a Gaussian random field with a Gaussian correlation.

    Parameters
    ----------
    amplitude : float, K
        Root mean square over many seeds (a single field with few blobs differs from it).
    length : (float, float, float), m
        Correlation lengths along x, y, z: the covariance at distance r along one of them is
        amplitude² exp(−r² / 2 length²). At least two cells along every axis.
    seed : int
        Every seed is another field; the same seed gives the same field, whatever the number of cells.
    depth : float, optional, m
        Height over which the unevenness dies away, as exp(-z / depth); left out, it does not.

    Notes
    -----
    The field is periodic along x and y and has no mean on any level, so that it leaves the mean profile
    alone. It is a finite Fourier sum along x and y, and white noise smoothed along z; neither depends on
    the mesh, only on its box.

    Limits: eddies of real air have a power-law spectrum down to millimetres; this has one scale.
    """

    amplitude: KelvinDifference = Field(gt=0)
    length: tuple[Metres, Metres, Metres]
    seed: int = Field(default=0, ge=0)
    depth: Metres | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _lengths(self) -> Self:
        if min(self.length) <= 0:
            raise ValueError("length: correlation lengths must be above zero")
        return self

    def sample(self, grid: Grid) -> np.ndarray:
        """The deviation from the mean profile on the cells of `grid`, (nz, ny, nx) float64, K.

        Raises
        ------
        InputError
            When a correlation length is below two cells.
        """
        self._require_resolved(grid)
        nz, ny, nx = grid.shape
        modes_x, modes_y = (
            math.floor(SPECTRUM_END * extent / (2 * math.pi * length))
            for extent, length in zip(_extents(grid), self.length[:2], strict=True)
        )
        generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(self.seed)))

        # vertical: white noise on a lattice, weighted by the square root of the covariance
        spacing = LATTICE * self.length[2]
        lattice = np.arange(-REACH, math.ceil(grid.z_edges[-1] / spacing) + REACH + 1) * spacing
        smoothing = np.exp(-(((grid.z[:, None] - lattice) / self.length[2]) ** 2))
        smoothing /= np.sqrt(np.sum(smoothing**2, axis=1, keepdims=True))

        # horizontal: independent Fourier amplitudes with the spectrum of the covariance, no mean
        mx = np.arange(-modes_x, modes_x + 1)
        my = np.arange(-modes_y, modes_y + 1)
        kx, ky = (2 * math.pi * m / extent for m, extent in zip((mx, my), _extents(grid), strict=True))
        spectrum = np.exp(-0.5 * ((kx * self.length[0]) ** 2 + (ky[:, None] * self.length[1]) ** 2))
        spectrum[modes_y, modes_x] = 0.0
        if not np.any(spectrum):
            raise InputError(
                "the box is too small for unevenness of this length",
                key="initial.unevenness.length",
                value=self.length,
                expected="horizontal lengths below the extent of the grid",
            )
        roots = np.sqrt(spectrum / np.sum(spectrum))

        # one lattice level after another, from below: a higher box only adds to the drawing
        field = np.zeros(grid.shape)
        wrap = np.ix_(my % ny, mx % nx)
        for level in range(lattice.size):
            pairs = generator.standard_normal((2, my.size, mx.size))
            near = np.flatnonzero(smoothing[:, level] > 1e-14)
            if near.size == 0:
                continue
            amplitudes = np.zeros((ny, nx), dtype=np.complex128)
            amplitudes[wrap] = roots * (pairs[0] + 1j * pairs[1])
            # cell centres lie half a cell beyond the corner of the box
            shift_x, shift_y = math.pi * _signed(nx) / nx, math.pi * _signed(ny) / ny
            amplitudes *= np.exp(1j * (shift_x + shift_y[:, None]))
            plane = np.fft.ifft2(amplitudes, norm="forward").real
            field[near] += smoothing[near, level, None, None] * plane
        fading = np.ones(nz) if self.depth is None else np.exp(-grid.z / self.depth)
        field *= (self.amplitude * fading)[:, None, None]
        return field

    def _require_resolved(self, grid: Grid) -> None:
        # height counts where the unevenness has not faded
        felt = grid.z < (math.inf if self.depth is None else 3 * self.depth)
        felt[0] = True
        widths = (grid.x_widths, grid.y_widths, grid.z_widths[felt])
        for axis, length, width in zip("xyz", self.length, widths, strict=True):
            cell = float(np.max(width))
            if width.size > 1 and length < 2 * cell * (1 - 1e-9):
                raise InputError(
                    f"a correlation length of {length:g} m along {axis} is under two cells of {cell:.4g} m",
                    key="initial.unevenness.length",
                    expected=f"at least {2 * cell:.4g} m along {axis}",
                    remedy="choose a larger length or more cells",
                )


@final
class ProfileTable(Value):
    """Temperatures [K] at increasing heights [m]; linear between, constant beyond."""

    heights: tuple[Metres, ...] = Field(min_length=2)
    temperatures: tuple[Kelvin, ...] = Field(min_length=2)

    @model_validator(mode="after")
    def _rows(self) -> Self:
        if len(self.heights) != len(self.temperatures):
            raise ValueError(f"{len(self.heights)} heights but {len(self.temperatures)} temperatures")
        if any(b <= a for a, b in zip(self.heights, self.heights[1:], strict=False)):
            raise ValueError("heights: must increase")
        if min(self.temperatures) <= 0:
            raise ValueError("temperatures: are in kelvin and above zero")
        return self


@final
class Initial(Value):
    """The temperature at the beginning.

    Exactly one of the first three is given.

    Parameters
    ----------
    temperature : float, K
        The same everywhere.
    profile : str or ProfileTable, K
        Function of the height z [m]: a formula such as ``"300 + 20*exp(-z/0.1)"``, or a table.
    dataset : path
        A file with `air_temperature` on axes x, y, z [m] and perhaps time, interpolated linearly to the
        cells; beyond its ends the outermost values continue.
    dataset_time : float, optional, s
        Instant of the dataset; its first one unless given.
    unevenness : tuple of Unevenness
        Added on top; several scales may be summed.

    Examples
    --------
    >>> from nigemizu.heat import GridSpec
    >>> grid = GridSpec(x=(0, 4), y=(0, 2), height=1.0, cells=(4, 2, 5)).build()
    >>> Initial(profile="300 - z").sample(grid)[:, 0, 0].round(6).tolist()
    [299.9, 299.7, 299.5, 299.3, 299.1]
    """

    temperature: Kelvin | None = Field(default=None, gt=0)
    profile: str | ProfileTable | None = None
    dataset: Path | None = None
    dataset_time: Seconds | None = None
    unevenness: tuple[Unevenness, ...] = ()

    @model_validator(mode="after")
    def _one(self) -> Self:
        if sum(part is not None for part in (self.temperature, self.profile, self.dataset)) != 1:
            raise ValueError("give exactly one of temperature, profile, dataset")
        if isinstance(self.profile, str):
            check_formula(self.profile, "z")
        if self.dataset_time is not None and self.dataset is None:
            raise ValueError("dataset_time: only with dataset")
        return self

    def sample(self, grid: Grid, *, available: Callable[[], int | None] = available_memory) -> np.ndarray:
        """The temperature on the cells of `grid`, (nz, ny, nx) float64, K.

        Raises
        ------
        InputError
            When it is not finite or not above zero kelvin somewhere, when a length is not resolved, or
            when the volume does not fit into memory.
        """
        require_memory(math.prod(grid.shape), available=available)
        if self.temperature is not None:
            volume = np.full(grid.shape, self.temperature)
        elif self.profile is not None:
            volume = np.empty(grid.shape)
            volume[:] = self._profile(grid.z)[:, None, None]
        else:
            volume = self._from_dataset(grid)
        for uneven in self.unevenness:
            volume += uneven.sample(grid)
        lowest = float(np.min(volume))  # NaN if any is
        if not lowest > 0 or not np.isfinite(np.max(volume)):
            raise InputError(
                "the initial temperature is not finite and above 0 K everywhere",
                key="initial",
                value=lowest,
                expected="kelvin",
            )
        return volume

    def _profile(self, height: np.ndarray) -> np.ndarray:
        if isinstance(self.profile, ProfileTable):
            return np.asarray(np.interp(height, self.profile.heights, self.profile.temperatures))
        assert self.profile is not None
        return evaluate_formula(self.profile, "z", height)

    def _from_dataset(self, grid: Grid) -> np.ndarray:
        from nigemizu.heat.dataset import read_air

        assert self.dataset is not None
        data = read_air(self.dataset)
        if "air_temperature" not in data:
            raise InputError(
                "the dataset tells no temperature without a pressure",
                key="initial.dataset",
                file=str(self.dataset),
                expected="air_temperature, or air_potential_temperature and air_pressure",
            )
        air = data["air_temperature"]
        if "time" in air.dims:
            stamps = air["time"].values
            time = float(stamps[0]) if self.dataset_time is None else self.dataset_time
            start = max(min(int(np.searchsorted(stamps, time)) - 1, stamps.size - 2), 0)
            air = air.isel(time=slice(start, start + 2)).interp(time=time)  # no other instant is read
        for axis in ("z", "y", "x"):
            if axis not in air.dims:
                air = air.expand_dims({axis: [0.0]})
        axes = [np.asarray(air[axis].values, dtype=np.float64) for axis in ("z", "y", "x")]
        volume = np.asarray(air.transpose("z", "y", "x").values, dtype=np.float64)
        if np.isnan(volume).any():
            raise InputError(
                "the dataset has no temperature at this instant",
                key="initial.dataset_time",
                file=str(self.dataset),
                value=self.dataset_time,
            )
        # linear interpolation in three dimensions is linear interpolation along one after the other
        for number, target in enumerate((grid.z, grid.y, grid.x)):
            volume = _interpolate(volume, number, axes[number], target)
        return volume


def _interpolate(volume: np.ndarray, number: int, axis: np.ndarray, target: np.ndarray) -> np.ndarray:
    if axis.size == 1:
        return np.repeat(volume, target.size, axis=number)
    place = np.clip(np.searchsorted(axis, target) - 1, 0, axis.size - 2)
    part = np.clip((target - axis[place]) / (axis[place + 1] - axis[place]), 0.0, 1.0)
    part = part.reshape([-1 if dimension == number else 1 for dimension in range(3)])
    lower, upper = np.take(volume, place, axis=number), np.take(volume, place + 1, axis=number)
    return np.asarray(lower + part * (upper - lower))


def _extents(grid: Grid) -> tuple[float, float]:
    return float(grid.x_edges[-1] - grid.x_edges[0]), float(grid.y_edges[-1] - grid.y_edges[0])


def _signed(count: int) -> np.ndarray:
    """Wave numbers in the order of the Fourier transform."""
    return np.asarray(np.fft.fftfreq(count, 1 / count))
