"""Fields in closed form: exact rays are known for them, so that tracers can be tested and shown."""

from __future__ import annotations

from typing import Any, Final, final

import drjit as dr

from nigemizu.errors import InputError
from nigemizu.field.base import UnboundedField
from nigemizu.field.cell import Cell
from nigemizu.field.types import Types

__all__ = [
    "ExponentialSquare",
    "ExponentialTemperature",
    "Fisheye",
    "GaussianBlob",
    "LinearSquare",
    "Luneburg",
    "ParabolicGrin",
    "Uniform",
]

FRACTION: Final = 0.5  # of the length over which a field changes by itself: the reach of one step
LAYER_STEP: Final = 2.0  # layer heights that a ray may fall in one step: the layer grows by e per stage
LAYER_TOP: Final = 14.0  # layer heights above which less than a millionth of the layer is left
BLOB_RADIUS: Final = 7.0  # standard deviations beyond which a blob is 2e-11 of its depth
LENS_EDGE: Final = {"single": 1e-5, "double": 1e-10}  # radii by which a ray may miss the lens's edge


@final
class Uniform(UnboundedField):
    """The same index everywhere: rays are straight.

    Parameters
    ----------
    types : Types
    index : float, 1
    """

    def __init__(self, types: Types, index: float = 1.0) -> None:
        super().__init__(types)
        _positive(index, "index")
        self._index = float(index)

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        return self.types.Float(self._index), self.types.Array3f(0)

    @property
    def stratified(self) -> bool:
        return True


@final
class LinearSquare(UnboundedField):
    """n² = a + b z: every ray is a parabola.

    Parameters
    ----------
    types : Types
    a : float, 1
    b : float, 1/m
        Where a + b z ≤ 0 there is no light; rays must not go there.
    """

    def __init__(self, types: Types, a: float, b: float) -> None:
        super().__init__(types)
        self._a, self._b = float(a), float(b)

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        n = dr.sqrt(self._a + self._b * position.z)
        return n, self.types.Array3f(0, 0, 0.5 * self._b / n)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        if self._b == 0:
            return super().cell(position, direction, active)
        to_darkness = abs(self._a + self._b * position.z) / abs(self._b)
        return Cell(self.value_and_gradient, reach=FRACTION * to_darkness)

    @property
    def stratified(self) -> bool:
        return True


@final
class ExponentialSquare(UnboundedField):
    """n² = a − A exp(−z/h): a hot layer over the ground, with rays z = z_t + 2h ln cosh(p∞ (σ − σ_t)/2h).

    Parameters
    ----------
    types : Types
    a : float, 1
        n² far above the ground.
    amplitude : float, 1
        A, by how much n² is less at the ground.
    height : float, m
        h, over which the layer thins out to 1/e.
    """

    def __init__(self, types: Types, a: float, amplitude: float, height: float) -> None:
        super().__init__(types)
        _positive(height, "height")
        self._a, self._amplitude, self._height = float(a), float(amplitude), float(height)

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        less = self._amplitude * dr.exp(position.z * (-1 / self._height))
        n = dr.sqrt(self._a - less)
        return n, self.types.Array3f(0, 0, less * (0.5 / self._height) / n)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        return Cell(self.value_and_gradient, reach=_fall(position, direction, self._height))

    @property
    def stratified(self) -> bool:
        return True


@final
class ParabolicGrin(UnboundedField):
    """n² = n₀² (1 − g² y²): a fibre along x, in which rays are sine waves.

    Parameters
    ----------
    types : Types
    index : float, 1
        n₀, on the axis.
    g : float, 1/m
    """

    def __init__(self, types: Types, index: float, g: float) -> None:
        super().__init__(types)
        _positive(index, "index")
        self._square, self._g2 = float(index) ** 2, float(g) ** 2

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        n = dr.sqrt(self._square * (1 - self._g2 * position.y * position.y))
        return n, self.types.Array3f(0, -self._square * self._g2 * position.y / n, 0)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        if self._g2 == 0:
            return super().cell(position, direction, active)
        return Cell(self.value_and_gradient, reach=self.types.Float(FRACTION * self._g2**-0.5))


@final
class Fisheye(UnboundedField):
    """Maxwell's fish-eye, n = 2/(1 + r²) about the origin: every ray is a circle."""

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        n = 2 / (1 + dr.squared_norm(position))
        return n, self.types.Array3f(-n * n * position)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        return Cell(self.value_and_gradient, reach=FRACTION * dr.sqrt(1 + dr.squared_norm(position)))


@final
class Luneburg(UnboundedField):
    """Luneburg's lens, n² = 2 − r² in the unit sphere and 1 outside: parallel light meets on the far rim."""

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        return self._piece(position, dr.squared_norm(position) <= 1)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        near = LENS_EDGE[self.types.precision]
        d = dr.normalize(direction)
        r2, along = dr.squared_norm(position), dr.dot(position, d)
        inside = dr.select(along > 0, r2 < 1 - 2 * near, r2 <= 1 + 2 * near)
        # The straight line meets the sphere where t² + 2 t (x·d) + r² − 1 = 0.
        root = dr.fma(along, along, 1 - r2)
        half_chord = dr.sqrt(dr.maximum(root, 0))
        to_lens = dr.select((root > 0) & (along < 0), -along - half_chord, dr.inf)
        # Light bends inwards, so that it stays inside for longer than the straight line would.
        reach = dr.select(inside, dr.minimum(half_chord - along, FRACTION), to_lens)
        return Cell(lambda point: self._piece(point, inside), reach=dr.maximum(reach, near))

    def _piece(self, position: Any, inside: Any) -> tuple[Any, Any]:
        # Far beyond its edge the inner formula would have no root.
        n = dr.select(inside, dr.sqrt(dr.maximum(2 - dr.squared_norm(position), 0.5)), 1)
        return n, self.types.Array3f(dr.select(inside, -position / n, 0))


@final
class ExponentialTemperature(UnboundedField):
    """Air with T = T₀ + ΔT exp(−k z) and n = 1 + C/T, as measured over asphalt.

    Parameters
    ----------
    types : Types
    temperature : float, K
        T₀, far above the ground.
    excess : float, K
        ΔT, by how much the ground is hotter.
    decay : float, 1/m
        k.
    refraction : float, K
        C = (n − 1) T; 7.86e-4 K/kPa × 101 kPa in the fit of the asphalt measurements.
    """

    def __init__(
        self,
        types: Types,
        temperature: float = 308.168,
        excess: float = 6.37,
        decay: float = 10.08,
        refraction: float = 7.86e-4 * 101,
    ) -> None:
        super().__init__(types)
        _positive(temperature, "temperature")
        self._temperature, self._excess = float(temperature), float(excess)
        self._decay, self._refraction = float(decay), float(refraction)

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        hotter = self._excess * dr.exp(-self._decay * position.z)
        per_kelvin = dr.rcp(self._temperature + hotter)
        refractivity = self._refraction * per_kelvin
        return 1 + refractivity, self.types.Array3f(0, 0, refractivity * per_kelvin * hotter * self._decay)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        return Cell(self.value_and_gradient, reach=_fall(position, direction, 1 / self._decay))

    @property
    def stratified(self) -> bool:
        return True


@final
class GaussianBlob(UnboundedField):
    """n = n₀ − ε exp(−(x² + y²)/2s²): a hot column along z.

    Parameters
    ----------
    types : Types
    depth : float, 1
        ε, by how much n is less on the axis.
    width : float, m
        s, the standard deviation.
    index : float, 1
        n₀, far away.
    """

    def __init__(self, types: Types, depth: float, width: float, index: float = 1.0) -> None:
        super().__init__(types)
        _positive(width, "width")
        self._depth, self._width, self._index = float(depth), float(width), float(index)

    def value_and_gradient(self, position: Any, active: Any = True) -> tuple[Any, Any]:
        x, y, per_s2 = position.x, position.y, self._width**-2
        less = self._depth * dr.exp((x * x + y * y) * (-0.5 * per_s2))
        slope = less * per_s2
        return self._index - less, self.types.Array3f(slope * x, slope * y, 0)

    def cell(self, position: Any, direction: Any, active: Any = True) -> Cell:
        d = dr.normalize(direction)
        across2 = dr.fma(d.x, d.x, d.y * d.y)
        per_across = dr.rsqrt(dr.maximum(across2, 1e-30))
        r2 = dr.fma(position.x, position.x, position.y * position.y)
        along = dr.fma(position.x, d.x, position.y * d.y) * per_across
        radius = BLOB_RADIUS * self._width
        root = dr.fma(along, along, radius * radius - r2)
        ahead = (root > 0) & (along < 0)
        to_blob = dr.select(ahead, -along - dr.sqrt(dr.maximum(root, 0)), dr.inf)
        within = dr.maximum(self._width, FRACTION * dr.sqrt(r2))
        # Along the axis nothing changes: only the way across it counts.
        across = dr.select(r2 < radius * radius, within, dr.maximum(to_blob, self._width))
        return Cell(self.value_and_gradient, reach=across * per_across)


def _fall(position: Any, direction: Any, height: float) -> Any:
    """Reach [m] of a step over an exponential layer of this height [m] at z = 0.

    A ray that falls meets gradients that it cannot feel from far above. It may fall to where the layer
    begins, and from there by a few layer heights at a time; one that rises feels all there is at once.
    """
    sine = -direction.z * dr.rsqrt(dr.squared_norm(direction))
    fall = dr.maximum(position.z - LAYER_TOP * height, LAYER_STEP * height)
    return dr.select(sine > 0, fall / dr.select(sine > 0, sine, 1), dr.inf)


def _positive(value: float, key: str) -> None:
    if not value > 0:
        raise InputError("must be positive", key=key, value=value)
