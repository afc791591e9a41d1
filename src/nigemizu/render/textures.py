"""Procedural textures as Mitsuba plug-ins, filtered over the footprint of a pixel.

A telephoto view along the ground squeezes a hundred metres into one pixel; patterns finer than a pixel are
replaced by their mean in closed form, so that no ray is spent on averaging them.
"""

from __future__ import annotations

import functools
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

__all__ = ["texture_classes"]

_TILE: Final = 512  # texels of the noise tile
_PERIOD: Final = 8  # texels per wavelength of its noise
_FINEST: Final = 0.02  # m, shortest wavelength of ground noise, across the view
_GRAIN: Final = 0.5  # m, below which noise loses its direction
_DRIFT: Final = 16.0  # sand lies in drifts, so many times longer (along x) than wide
_WEAR: Final = 40.0  # the same of the marks that wheels leave on a road
_RIPPLE: Final = 0.25  # m, from crest to crest


def noise_tile(seed: int) -> NDArray[np.float32]:
    """A periodic image of smooth noise of one wavelength: (512, 512) float32, mean 0, rms 1."""
    frequency = np.fft.fftfreq(_TILE) * _PERIOD
    radius = np.hypot(frequency[:, None], frequency[None, :])
    band = np.exp(-(((radius - 1.0) / 0.35) ** 2))
    white = np.random.default_rng(np.random.SeedSequence(seed)).standard_normal((_TILE, _TILE))
    image = np.fft.ifft2(np.fft.fft2(white) * band).real
    return np.asarray((image - image.mean()) / image.std(), dtype=np.float32)


def covered_by_dots(density: float) -> float:
    """Share of a plane that is covered by dots, one at random in each square, of this area in squares.

    A point is bare if no dot's middle lies in the disc around it: one minus its part of each square.
    """
    steps = (np.arange(24) + 0.5) / 24
    radius, angle = np.sqrt(density / np.pi * steps)[:, None], 2 * np.pi * steps
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)
    bare = 0.0
    for x in steps:
        for y in steps:
            squares = np.floor(disc + np.array([x, y]))
            _, counts = np.unique(squares @ [7.0, 1.0], return_counts=True)
            bare += float(np.prod(1 - density * counts / len(disc)))
    return 1 - bare / len(steps) ** 2


@functools.cache
def texture_classes(variant: str) -> dict[str, Any]:
    """Plug-in name → class, under `variant`, which must be the one in use."""

    class Procedural(mi.Texture):
        """A pattern in scene coordinates, seen from `eye` with pixels of `pixel_angle` radians."""

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.eye = _opaque(mi.Point3f(props.get("eye", mi.ScalarPoint3f(0))))
            self.pixel_angle = dr.opaque(mi.Float, props.get("pixel_angle", 1e-3))
            self.colour = _opaque(mi.Color3f(props["colour"]))
            self.contrast = dr.opaque(mi.Float, props.get("contrast", 0.0))
            tile = mi.TensorXf(noise_tile(props.get("seed", 0))[..., None])
            texture: Any = mi.Texture2f
            self.tile = texture(tile, wrap_mode=dr.WrapMode.Repeat)

        def footprint(self, si: Any) -> tuple[Any, Any, Any]:
            """Width of a pixel on the surface across the line of sight, and its extents along x and y."""
            sight = si.p - self.eye
            distance = dr.norm(sight)
            across = self.pixel_angle * distance
            along = across / dr.maximum(dr.abs(dr.dot(sight, si.n)) / distance, 1e-5)
            level = dr.maximum(dr.sqrt(sight.x**2 + sight.y**2), 1e-6)
            x, y = dr.abs(sight.x) / level, dr.abs(sight.y) / level
            return across, along * x + across * y, along * y + across * x

        def noise(self, x: Any, y: Any, length: float, turn: float) -> Any:
            """Noise of wavelength `length`, turned by `turn` radians so that octaves do not line up."""
            scale = _PERIOD / (_TILE * length)
            c, s = float(np.cos(turn)) * scale, float(np.sin(turn)) * scale
            return self.tile.eval(mi.Point2f(c * x - s * y + 0.37 * turn, s * x + c * y + 0.61 * turn))[0]

        def octaves(
            self, si: Any, wide: tuple[Any, Any], coarsest: float, finest: float, stretch: float
        ) -> Any:
            """Sum of ever finer noise; what is finer than a pixel fades away.

            Patches are up to `stretch` times longer along x; grain has no direction.
            """
            total, length, turn = mi.Float(0), coarsest, 0.3
            while length >= finest:
                longer = 1 + (stretch - 1) * min(length / _GRAIN, 1.0)
                reach = (wide[0] / longer) ** 2 + wide[1] ** 2
                visible = dr.exp(-reach / (0.5 * length) ** 2)
                total += 0.3 * visible * self.noise(si.p.x / longer, si.p.y, length, turn)
                length, turn = length / 2.9, turn + 1.1
            return total

        def pattern(self, si: Any) -> Any:
            return self.colour

        def eval(self, si: Any, active: Any = True) -> Any:
            return dr.clip(self.pattern(si), 0, 1)

        def eval_1(self, si: Any, active: Any = True) -> Any:
            return mi.luminance(self.eval(si, active))

        def mean(self) -> Any:
            return mi.luminance(self.colour)

        def is_spatially_varying(self) -> bool:
            return True

        def to_string(self) -> str:
            return f"{type(self).__name__}[]"

    class Ground(Procedural):
        """Sand, and on it a road along x (none where its width is 0)."""

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.scale = float(props.get("scale", 100.0))
            self.road = float(props.get("road_width", 0.0))
            self.centre = float(props.get("road_centre", 0.0))
            self.asphalt = mi.Color3f(props.get("road_colour", mi.ScalarColor3f(0.1)))
            self.grain = float(props.get("road_contrast", 0.0))
            self.paint = mi.Color3f(props.get("line_colour", mi.ScalarColor3f(0.6)))
            self.line = float(props.get("line_width", 0.15))
            self.inset = float(props.get("edge_inset", 0.25))
            self.dash = float(props.get("dash", 6.0))
            self.gap = float(props.get("gap", 9.0))

        def pattern(self, si: Any) -> Any:
            _, wide_x, wide_y = wide = self.footprint(si)
            uneven = self.octaves(si, wide[1:], self.scale / _DRIFT, _FINEST, _DRIFT)
            # Wind ripples across the line of sight, an even tone wherever a pixel covers some of them.
            ripples = self.noise(si.p.x / _RIPPLE, si.p.y / 5 / _RIPPLE, 1.0, 0.05)
            uneven += 0.3 * dr.exp(-((wide_x / (0.5 * _RIPPLE)) ** 2)) * ripples
            # Bright sand is a little yellower than dark sand.
            tint = mi.Color3f(1.0, 0.97, 0.9)
            sand = self.colour * (1 + self.contrast * uneven * tint)
            if self.road == 0:
                return sand
            y = si.p.y - self.centre
            half = self.road / 2
            # The edge of the asphalt crumbles: sand and stones lie on it here and there.
            crumbs = 0.15 * self.octaves(si, wide[1:], 0.5, 0.04, 30.0)
            on_road = _strip(dr.abs(y) + crumbs, -half, half, wide_y + 0.25)
            return dr.lerp(sand, self.road_surface(si, y, wide_x, wide_y), on_road)

        def road_surface(self, si: Any, y: Any, wide_x: Any, wide_y: Any) -> Any:
            half, lane = self.road / 2, self.road / 4
            # Wheels polish two tracks per lane, and oil darkens the stripe between them.
            from_lane = dr.abs(dr.abs(y) - lane)
            tracks = dr.exp(-(((from_lane - 0.8) / 0.3) ** 2)) - 0.6 * dr.exp(-((from_lane / 0.35) ** 2))
            grain = self.octaves(si, (wide_x, wide_y), 0.4, 0.01, _WEAR)
            surface = self.asphalt * (1 + 0.12 * tracks + self.grain * grain)
            edge = half - self.inset
            lines = _strip(dr.abs(y), edge - self.line, edge, wide_y)
            period = self.dash + self.gap
            dashes = _strip(y, -self.line / 2, self.line / 2, wide_y) * _pulses(
                si.p.x, self.dash, period, wide_x
            )
            worn = 0.92 + 0.06 * grain
            return dr.lerp(surface, self.paint * worn, dr.minimum(lines + dashes, 1))

    class Checker(Procedural):
        """Chessboard of horizontal coordinates."""

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.other = _opaque(mi.Color3f(props["other"]))
            self.size = float(props["size"])

        def pattern(self, si: Any) -> Any:
            _, wide_x, wide_y = self.footprint(si)
            x = 2 * _pulses(si.p.x, self.size, 2 * self.size, wide_x) - 1
            y = 2 * _pulses(si.p.y, self.size, 2 * self.size, wide_y) - 1
            return dr.lerp(self.colour, self.other, 0.5 + 0.5 * x * y)

    class Placed(Procedural):
        """A pattern that goes with an object, at `centre` and turned about the vertical by `turn` radians."""

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.salt = 100_000 * (1 + props.get("seed", 0) % 40_000)
            self.centre = mi.ScalarPoint3f(props.get("centre", mi.ScalarPoint3f(0)))
            self.turn = float(props.get("turn", 0.0))

        def own(self, si: Any) -> tuple[Any, Any]:
            """Place and normal in the object's own coordinates."""
            c, s = float(np.cos(self.turn)), float(np.sin(self.turn))
            p, n = si.p - self.centre, si.n
            return (
                mi.Point3f(c * p.x + s * p.y, c * p.y - s * p.x, p.z),
                mi.Normal3f(c * n.x + s * n.y, c * n.y - s * n.x, n.z),
            )

    class Dots(Placed):
        """Dots in the plane that the surface faces: one at random in each square of a grid."""

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.other = _opaque(mi.Color3f(props["other"]))
            self.radius = float(props["diameter"]) / 2
            density = float(props["density"])
            self.side = self.radius * float(np.sqrt(np.pi / density))
            self.mean_covered = covered_by_dots(density)

        def pattern(self, si: Any) -> Any:
            across, _, _ = self.footprint(si)
            p, n = self.own(si)
            upright = dr.abs(n.z) < 0.7
            facing_x = dr.abs(n.x) > dr.abs(n.y)
            x = dr.select(upright & facing_x, p.y, p.x) / self.side
            y = dr.select(upright, p.z, p.y) / self.side
            column, row = dr.floor(x), dr.floor(y)
            bare = mi.Float(1)
            for up in (-1, 0, 1):
                for right in (-1, 0, 1):
                    away = self.distance(x - (column + right), y - (row + up), column + right, row + up)
                    edge = (self.radius - self.side * away) / dr.maximum(across, 1e-9)
                    bare *= 1 - dr.clip(edge + 0.5, 0, 1)
            # Of dots much smaller than a pixel the mean is left.
            visible = dr.exp(-((across / (4 * self.radius)) ** 4))
            covered = dr.lerp(mi.Float(self.mean_covered), 1 - bare, visible)
            return dr.lerp(self.colour, self.other, covered)

        def distance(self, x: Any, y: Any, column: Any, row: Any) -> Any:
            """From (x, y) in a square to its dot, in sides of the square."""
            first: Any = mi.UInt32(mi.Int32(column)) + self.salt
            second: Any = mi.UInt32(mi.Int32(row))
            a, b = mi.sample_tea_32(first, second, 16)
            return dr.sqrt((x - mi.Float(a) * 2.0**-32) ** 2 + (y - mi.Float(b) * 2.0**-32) ** 2)

    class Masonry(Placed):
        """Courses of stones."""

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.course = float(props["course"])

        def pattern(self, si: Any) -> Any:
            across, _, _ = self.footprint(si)
            p, n = self.own(si)
            along = dr.select(dr.abs(n.x) > dr.abs(n.y), p.y, p.x + 1000.0)
            row = dr.floor(p.z / self.course)
            length = 1.7 * self.course
            shifted = along / length + 0.618 * row
            stone = dr.floor(shifted)
            own = self.lottery(row, stone)
            whole_row = self.lottery(row, mi.Float(-7))
            stain = self.noise(along, 1.4 * p.z, 9 * self.course, 0.9)
            stain += self.noise(along, 1.4 * p.z, 2.7 * self.course, 2.1)
            joint = _strip(p.z - row * self.course, 0, 0.1 * self.course, across)
            side = _strip((shifted - stone) * length, 0, 0.08 * self.course, across)
            shade = 1 + self.contrast * (0.3 * own + 0.15 * whole_row + 0.22 * stain)
            return self.colour * shade * (1 - 0.35 * dr.maximum(joint, side))

        def lottery(self, a: Any, b: Any) -> Any:
            """A random number of mean 0 and rms 1 that depends on two whole numbers and the seed."""
            row: Any = mi.UInt32(mi.Int32(a)) + self.salt
            stone: Any = mi.UInt32(mi.Int32(b))
            drawn = mi.sample_tea_float32(row, stone)
            return (drawn - 0.5) * float(np.sqrt(12.0))

    return {
        "nigemizu_ground": Ground,
        "nigemizu_checker": Checker,
        "nigemizu_dots": Dots,
        "nigemizu_masonry": Masonry,
    }


def _opaque(value: Any) -> Any:
    """A value that the kernel reads instead of having it compiled in."""
    dr.make_opaque(value)
    return value


def _strip(y: Any, lower: Any, upper: Any, width: Any) -> Any:
    """Part of the interval of `width` around y that lies between lower and upper."""
    width = dr.maximum(width, 1e-3)
    return dr.clip((dr.minimum(y + width / 2, upper) - dr.maximum(y - width / 2, lower)) / width, 0, 1)


def _pulses(x: Any, on: float, period: float, width: Any) -> Any:
    """Mean over `width` around x of a wave that is 1 for the length `on` of each `period`, else 0."""
    width = dr.maximum(width, 2e-2)

    def integral(position: Any) -> Any:
        whole = dr.floor(position / period)
        return whole * on + dr.minimum(position - whole * period, on)

    mean = (integral(x + width / 2) - integral(x - width / 2)) / width
    # Over many periods the mean is all that is left, and the difference above would lose its digits.
    return dr.select(width > 8 * period, on / period, dr.clip(mean, 0, 1))
