"""Turbulence beyond the grid, added to the air through which a scene is seen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError

if TYPE_CHECKING:
    from nigemizu.heat.turbulence.field import TurbulentField
    from nigemizu.scene.model import Scene

__all__ = ["AddedTurbulence", "Division"]

FloatArray = NDArray[np.float64]


@final
class AddedTurbulence:
    """Adds a scene's turbulence to refractivities of any instant; set up with the first of them.

    Notes
    -----
    At constant pressure n − 1 falls as 1/T: fluctuations T' make of it (n − 1)/(1 + T'/T), T being the
    horizontal mean. The skin of the ground, where it is a node of its own, keeps its temperature.

    Where the turbulence has a `spacing` of its own, the cells of the air are divided first. The nodes between
    take what is linear between those of the air, which without turbulence bends light as before.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._field: TurbulentField | None = None
        self._axes: tuple[FloatArray, ...] = ()
        self._divisions: tuple[Division, ...] = ()

    def to(
        self,
        x: FloatArray,
        y: FloatArray,
        z: FloatArray,
        refractivity: FloatArray,
        temperature: FloatArray | None,
        time: float,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray | None]:
        """The air of an instant with its turbulence.

        Parameters
        ----------
        x, y, z : (nx,), (ny,), (nz,) float64, m
        refractivity : (nz, ny, nx) float64, 1
        temperature : (nz,) float64, K
            Horizontal mean.
        time : float, s

        Returns
        -------
        x, y, z, refractivity, temperature
            On the mesh of the turbulence, which is that of the air unless it has a `spacing`.

        Raises
        ------
        InputError
            Where the temperature is unknown or the nodes are not equally spaced along x and y.
        """
        turbulence = self._scene.turbulence
        if turbulence is None:
            return x, y, z, refractivity, temperature
        if temperature is None:
            raise InputError(
                "turbulence needs the temperature of the air, and the dataset holds its refractivity alone",
                key="turbulence",
            )
        axes = (x, y, z)
        if len(self._axes) != len(axes) or not all(map(np.array_equal, axes, self._axes)):
            spacing = turbulence.spacing or (math.inf,) * 3
            self._divisions = tuple(map(Division.of, axes, spacing))
            self._field = self._make_field(*(division.nodes for division in self._divisions))
            self._axes = axes
        assert self._field is not None
        for axis, division in zip((2, 1, 0), self._divisions, strict=True):
            refractivity = division.fill(refractivity, axis)
        temperature = self._divisions[2].fill(temperature, 0)
        x, y, z = (division.nodes for division in self._divisions)
        skin = int(z[0] == 0.0)
        added = refractivity.copy()
        added[skin:] /= 1.0 + self._field.at(time) / temperature[skin:, None, None]
        return x, y, z, added, temperature

    def _make_field(self, x: FloatArray, y: FloatArray, z: FloatArray) -> TurbulentField:
        """The turbulence at these nodes, without the skin of the ground."""
        from nigemizu.heat import Grid
        from nigemizu.heat.turbulence.field import TurbulentField

        assert self._scene.turbulence is not None
        axes = (x, y, z[int(z[0] == 0.0) :])
        grid = self._scene.require_heated().grid.build()
        if not all(
            a.shape == b.shape and np.allclose(a, b)
            for a, b in zip(axes, (grid.x, grid.y, grid.z), strict=True)
        ):
            grid = Grid(_faces(axes[0]), _faces(axes[1]), _faces(axes[2], 0.0))
        return TurbulentField(grid, self._scene.turbulence, self._scene.wind)


@final
@dataclass(frozen=True)
class Division:
    """Nodes put in between those of an axis, and the way of values to them: linear.

    Attributes
    ----------
    nodes : (m,) float64, m
    before : (m,) int64
        The node of the axis before each, the last but one at most.
    fraction : (m,) float64
        How far each lies on the way to the next.
    """

    nodes: FloatArray
    before: NDArray[np.int64]
    fraction: FloatArray

    @classmethod
    def of(cls, nodes: FloatArray, spacing: float) -> Self:
        """Divide the intervals of an axis that are longer than `spacing` into equal parts."""
        widths = np.diff(nodes)
        parts = np.maximum(np.ceil(widths / spacing * (1 - 1e-9)), 1).astype(np.int64)
        before = np.repeat(np.arange(widths.size), parts)
        number = np.arange(before.size) - np.repeat(np.cumsum(parts) - parts, parts)
        fraction = number / parts[before] if before.size else np.zeros(0)
        if not widths.size:
            return cls(nodes, np.zeros(1, dtype=np.int64), np.zeros(1))
        return cls(
            np.append(nodes[before] + fraction * widths[before], nodes[-1]),
            np.append(before, widths.size - 1),
            np.append(fraction, 1.0),
        )

    def fill(self, values: FloatArray, axis: int) -> FloatArray:
        """Values at the nodes of the axis, along one of the array's axes, at all the nodes."""
        if values.shape[axis] == self.nodes.size:
            return values
        along = [1] * values.ndim
        along[axis] = -1
        low = np.take(values, self.before, axis=axis)
        step = np.take(np.diff(values, axis=axis), self.before, axis=axis)
        step *= self.fraction.reshape(along)
        step += low
        return step


def _faces(centres: FloatArray, first: float | None = None) -> FloatArray:
    """Faces of cells whose centres these are: for equal cells, or from a first face on."""
    if first is None:
        step = (centres[-1] - centres[0]) / (centres.size - 1)
        return np.asarray(centres[0] + step * (np.arange(centres.size + 1) - 0.5))
    middles = 0.5 * (centres[1:] + centres[:-1])
    above = centres[-1] + (centres[-1] - middles[-1]) if centres.size > 1 else 2 * centres[-1] - first
    return np.concatenate([[min(first, centres[0] - 1e-6)], middles, [above]])
