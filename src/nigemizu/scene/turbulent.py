"""Turbulence beyond the grid, added to the air through which a scene is seen."""

from __future__ import annotations

from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError

if TYPE_CHECKING:
    from nigemizu.heat.turbulence.field import TurbulentField
    from nigemizu.scene.model import Scene

__all__ = ["AddedTurbulence"]

FloatArray = NDArray[np.float64]


@final
class AddedTurbulence:
    """Adds a scene's turbulence to refractivities of any instant; set up with the first of them.

    Notes
    -----
    At constant pressure n − 1 falls as 1/T: fluctuations T' make of it (n − 1)/(1 + T'/T), T being the
    horizontal mean. The skin of the ground, where it is a node of its own, keeps its temperature.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._field: TurbulentField | None = None
        self._axes: tuple[FloatArray, ...] = ()

    def to(
        self,
        x: FloatArray,
        y: FloatArray,
        z: FloatArray,
        refractivity: FloatArray,
        temperature: FloatArray | None,
        time: float,
    ) -> FloatArray:
        """n − 1 (nz, ny, nx) with the turbulence of an instant [s].

        Parameters
        ----------
        x, y, z : (nx,), (ny,), (nz,) float64, m
        refractivity : (nz, ny, nx) float64, 1
        temperature : (nz,) float64, K
            Horizontal mean.
        time : float, s

        Raises
        ------
        InputError
            Where the temperature is unknown or the nodes are not equally spaced along x and y.
        """
        if self._scene.turbulence is None:
            return refractivity
        if temperature is None:
            raise InputError(
                "turbulence needs the temperature of the air, and the dataset holds its refractivity alone",
                key="turbulence",
            )
        skin = int(z[0] == 0.0)
        field = self._prepared(x, y, z[skin:])
        added = refractivity.copy()
        added[skin:] /= 1.0 + field.at(time) / temperature[skin:, None, None]
        return added

    def _prepared(self, x: FloatArray, y: FloatArray, z: FloatArray) -> TurbulentField:
        from nigemizu.heat import Grid
        from nigemizu.heat.turbulence.field import TurbulentField

        axes = (x, y, z)
        known = len(self._axes) == len(axes) and all(map(np.array_equal, axes, self._axes))
        if self._field is None or not known:
            assert self._scene.turbulence is not None
            grid = self._scene.grid.build()
            if not all(
                a.shape == b.shape and np.allclose(a, b)
                for a, b in zip(axes, (grid.x, grid.y, grid.z), strict=True)
            ):
                grid = Grid(_faces(x), _faces(y), _faces(z, 0.0))
            self._field = TurbulentField(grid, self._scene.turbulence, self._scene.wind)
            self._axes = axes
        return self._field


def _faces(centres: FloatArray, first: float | None = None) -> FloatArray:
    """Faces of cells whose centres these are: for equal cells, or from a first face on."""
    if first is None:
        step = (centres[-1] - centres[0]) / (centres.size - 1)
        return np.asarray(centres[0] + step * (np.arange(centres.size + 1) - 0.5))
    middles = 0.5 * (centres[1:] + centres[:-1])
    above = centres[-1] + (centres[-1] - middles[-1]) if centres.size > 1 else 2 * centres[-1] - first
    return np.concatenate([[min(first, centres[0] - 1e-6)], middles, [above]])
