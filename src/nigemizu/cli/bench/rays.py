"""Ray-steps per second through a voxel volume, beside a loop written by hand for this one volume."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.cli.bench.timing import OFTEN, alternate
from nigemizu.progress import SILENT, ProgressMeter

if TYPE_CHECKING:
    from nigemizu.field import Field, Types

__all__ = [
    "FLAT",
    "STEP",
    "Voxels",
    "by_hand",
    "control",
    "flat_rays",
    "measure_march",
    "settle",
    "stratified_field",
]

FloatArray = NDArray[np.float64]

STEP = 1.0  # m
THINNEST = 0.001  # m; lowest cell of the stretched volume


@final
@dataclass(frozen=True)
class Voxels:
    """A volume of uneven air over a hot ground, from (0, −width/2, 0).

    Attributes
    ----------
    nodes : (int, int, int)
        Number of nodes along x, y and z.
    extent : (float, float, float), m
        Length, width and height.
    """

    nodes: tuple[int, int, int] = (256, 256, 128)
    extent: tuple[float, float, float] = (700.0, 60.0, 12.8)

    @property
    def horizontal(self) -> tuple[FloatArray, FloatArray]:
        """Nodes along x and y, m."""
        length, width = self.extent[:2]
        return np.linspace(0.0, length, self.nodes[0]), np.linspace(-width / 2, width / 2, self.nodes[1])

    @property
    def even_heights(self) -> FloatArray:
        """Heights of the nodes at equal distances, m."""
        return np.linspace(0.0, self.extent[2], self.nodes[2])

    @property
    def stretched_heights(self) -> FloatArray:
        """Heights of the nodes whose distance grows from 1 mm by a constant ratio, m."""
        from nigemizu.heat import GridSpec

        cells = (1, 1, self.nodes[2] - 1)
        spec = GridSpec(x=(0, 1), y=(0, 1), height=self.extent[2], cells=cells, first_cell=THINNEST)
        return np.asarray(spec.build().z_edges)

    def air(self, z: FloatArray) -> FloatArray:
        """n − 1 on the nodes at the heights `z` [m], shape (nz, ny, nx)."""
        nx, ny, nz = self.nodes
        layer = 2.7e-4 - 2e-5 * np.exp(-z / 0.3)
        uneven = np.random.default_rng(7).standard_normal((nz, ny, nx))
        return np.asarray(layer[:, None, None] + 1e-8 * uneven)


FLAT = Voxels()
"""What the march is measured in."""


def flat_rays(types: Types, count: int) -> tuple[Any, Any]:
    """Origins and directions (Array3f) of about `count` nearly flat rays, in the order of pixels."""
    side = int(np.sqrt(count))
    across, up = np.meshgrid(np.linspace(-0.03, 0.03, side), np.linspace(-0.001, 0.008, side))
    direction = np.stack([np.ones_like(up), across, up]).reshape(3, -1)
    direction /= np.linalg.norm(direction, axis=0)
    return types.Array3f(0.5, 0, 1.5), types.Array3f(direction)


def settle(results: Any) -> Any:
    """Wait until device arrays are computed; returns them."""
    import drjit as dr

    dr.eval(results)
    dr.sync_thread()
    return results


def control(angle: float) -> dict[str, Any]:
    """How `trace.march` is told to keep displacements, seen from the eye, below `angle` [rad]."""
    return {"accuracy": angle, "max_steps": 100_000}


def stratified_field(z: FloatArray, refractivity: FloatArray, types: Types) -> Field:
    """Air that varies with height alone, from n − 1 at the heights `z` [m]."""
    from nigemizu import field

    column = refractivity[:, None, None]
    return field.StratifiedVolume([0.0], [0.0], z, column, types, "extend")


def by_hand(
    types: Types, voxels: Any, shape: Voxels, origin: Any, direction: Any, steps: int, step: float = STEP
) -> Any:
    """The least that a leapfrog march through evenly spaced voxels can do.

    Parameters
    ----------
    types : Types
    voxels : Float, 1
        n − 1 at the nodes, x fastest.
    shape : Voxels
    origin, direction : Array3f, m and 1
    steps : int
    step : float, m

    Returns
    -------
    Array3f, m
        Where the rays are after so many steps.
    """
    import drjit as dr

    nx, ny, nz = shape.nodes
    length, width, height = shape.extent
    lower = types.Array3f(0, -width / 2, 0)
    scale = types.Array3f((nx - 1) / length, (ny - 1) / width, (nz - 1) / height)
    row, layer = nx, nx * ny

    def pair(index: Any) -> tuple[Any, Any]:
        return dr.gather(types.Float, voxels, index), dr.gather(types.Float, voxels, index + 1)

    def advance(x: Any, p: Any, k: Any) -> tuple[Any, Any, Any]:
        x = x + p * (0.5 * step)
        q = (x - lower) * scale
        i = dr.minimum(types.UInt32(dr.maximum(q.x, 0)), nx - 2)
        j = dr.minimum(types.UInt32(dr.maximum(q.y, 0)), ny - 2)
        m = dr.minimum(types.UInt32(dr.maximum(q.z, 0)), nz - 2)
        u, v, w = q.x - types.Float(i), q.y - types.Float(j), q.z - types.Float(m)
        c = (m * ny + j) * nx + i
        (f000, f001), (f010, f011) = pair(c), pair(c + row)
        (f100, f101), (f110, f111) = pair(c + layer), pair(c + (layer + row))
        x00, x01, x10, x11 = f001 - f000, f011 - f010, f101 - f100, f111 - f110
        e00, e01 = dr.fma(u, x00, f000), dr.fma(u, x01, f010)
        e10, e11 = dr.fma(u, x10, f100), dr.fma(u, x11, f110)
        f0, f1 = dr.fma(v, e01 - e00, e00), dr.fma(v, e11 - e10, e10)
        across = dr.lerp(dr.lerp(x00, x01, v), dr.lerp(x10, x11, v), w)
        slope = types.Array3f(across, dr.lerp(e01 - e00, e11 - e10, w), f1 - f0)
        n = 1 + dr.fma(w, f1 - f0, f0)
        p = p + slope * scale * (n * step)
        return x + p * (0.5 * step), p, k + 1

    state = (types.Array3f(origin), types.Array3f(direction), types.UInt32(0))
    return dr.while_loop(state, lambda x, p, k: k < steps, advance, label="by hand")[0]


def measure_march(
    shape: Voxels = FLAT,
    rays: int = 2**19,
    steps: int = 256,
    repeats: int = OFTEN,
    *,
    progress: ProgressMeter = SILENT,
) -> dict[str, Any]:
    """Ray-steps per second at a fixed step, without geometry, in evenly spaced and in stretched cells.

    Parameters
    ----------
    shape : Voxels
    rays, steps : int
        Number of rays, and of steps that each makes at most.
    repeats : int
    progress : ProgressMeter

    Returns
    -------
    dict
        ``by_hand``, ``uniform`` and ``stretched``: ray-steps per second [1/s]; ``uniform_over_by_hand`` and
        ``stretched_over_by_hand`` [1].
    """
    from nigemizu import field, trace

    types = field.types("llvm")
    origin, direction = flat_rays(types, rays)
    even = shape.even_heights
    voxels = types.Float(shape.air(even).astype(np.float32).ravel())

    def marching(z: FloatArray) -> Callable[[], Any]:
        volume = field.TrilinearVolume(*shape.horizontal, z, shape.air(z), types)
        return lambda: settle(trace.march(volume, origin, direction, step=STEP, max_steps=steps))

    works: dict[str, Callable[[], Any]] = {
        "by_hand": lambda: settle(by_hand(types, voxels, shape, origin, direction, steps)),
        "uniform": marching(even),
        "stretched": marching(shape.stretched_heights),
    }
    made = {name: float(np.sum(works[name]().steps)) for name in ("uniform", "stretched")}
    made["by_hand"] = float(steps * int(np.sqrt(rays)) ** 2)
    seconds = alternate(works, repeats, label="march", progress=progress)
    rates = {name: made[name] / taken for name, taken in seconds.items()}
    over = {f"{name}_over_by_hand": rates[name] / rates["by_hand"] for name in ("uniform", "stretched")}
    return {"rays": rays, "steps": steps, **rates, **over}
