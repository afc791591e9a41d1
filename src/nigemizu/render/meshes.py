"""Triangle meshes of the built objects, as arrays: no renderer needed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from nigemizu.render.objects import Hills, Pyramid

__all__ = [
    "Triangles",
    "box",
    "cylinder",
    "ellipsoid",
    "hills",
    "loft",
    "merged",
    "plain",
    "pyramid",
    "pyramid_faces",
    "quad_strip",
]

Vertices = NDArray[np.float64]
Faces = NDArray[np.int64]


@final
@dataclass(frozen=True)
class Triangles:
    """A triangle mesh.

    Parameters
    ----------
    vertices : (N, 3) float64, m
        Points.
    faces : (M, 3) int64
        Their indices, anticlockwise seen from outside.
    smooth : bool
        Whether the shading rounds the edges.
    coordinates : (N, 2) float64, optional
        Texture coordinates.
    """

    vertices: Vertices
    faces: Faces
    smooth: bool = False
    coordinates: NDArray[np.float64] | None = None

    def moved(self, position: tuple[float, float, float], rotation: float = 0.0) -> Triangles:
        """Turned about the vertical by `rotation` degrees (positive to the left), then moved."""
        c, s = math.cos(math.radians(rotation)), math.sin(math.radians(rotation))
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return replace(self, vertices=self.vertices @ turn.T + np.asarray(position))


def box(size: tuple[float, float, float]) -> Triangles:
    """A box on z = 0, centred in x and y."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    bottom = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], dtype=np.float64)
    return loft(np.stack([bottom, bottom + np.array([0, 0, z])]))


def loft(loops: NDArray[np.float64], smooth: bool = False) -> Triangles:
    """Skin over closed loops of equally many points, with flat caps.

    Parameters
    ----------
    loops : (L, N, 3) float64, m
        Loops, each anticlockwise seen from the side of the last one.
    """
    count, around = loops.shape[:2]
    sides = _grid_faces(count, around, closed=True)
    start, end = count * around, count * around + 1
    k = np.arange(around)
    following = (k + 1) % around
    top = (count - 1) * around
    caps = np.concatenate(
        [
            np.stack([following, k, np.full(around, start)], axis=1),
            np.stack([top + k, top + following, np.full(around, end)], axis=1),
        ]
    )
    centres = np.stack([loops[0].mean(axis=0), loops[-1].mean(axis=0)])
    vertices = np.concatenate([loops.reshape(-1, 3), centres])
    return Triangles(vertices, np.concatenate([sides, caps]), smooth)


def merged(parts: Sequence[Triangles]) -> Triangles:
    """Meshes as one, without texture coordinates; smooth if the first is."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=True)]
    return Triangles(
        np.concatenate([part.vertices for part in parts]), np.concatenate(faces), parts[0].smooth
    )


def quad_strip(rows: NDArray[np.float64], smooth: bool = False) -> Triangles:
    """An open surface through rows of points (L, N, 3)."""
    return Triangles(rows.reshape(-1, 3), _grid_faces(rows.shape[0], rows.shape[1], closed=False), smooth)


def plain(height: float) -> Triangles:
    """Flat ground z = `height` out to 1000 km, where its edge is 2 µrad below a standing eye's horizon.

    Hit points are interpolated between the corners of a triangle in single precision: in one rectangle of
    this size they are off by 0.2 m. Rings of ever larger cells keep the error under 10⁻⁶ of the distance
    (0.02 mm at 60 m, 4 mm at 20 km). Texture coordinates are x and y in metres.
    """
    rings = np.array([1e2, 1e3, 1e4, 1e5, 1e6])
    edges = np.concatenate([-rings[::-1], rings])
    x, y = np.meshgrid(edges, edges)
    points = np.stack([x, y, np.full_like(x, height)], axis=-1)
    return replace(quad_strip(points), coordinates=points[..., :2].reshape(-1, 2))


def pyramid_faces(shape: Pyramid) -> Triangles:
    """The four faces of a smooth pyramid, each with an image upright on it: base corners (0, 0), (1, 0)."""
    half = shape.base / 2
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * half
    vertices = np.zeros((4, 3, 3))
    vertices[:, 0, :2], vertices[:, 1, :2] = corners, np.roll(corners, -1, axis=0)
    vertices[:, 2, 2] = shape.height
    coordinates = np.tile([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]], (4, 1))
    return Triangles(vertices.reshape(-1, 3), np.arange(12).reshape(4, 3), coordinates=coordinates)


def cylinder(start: Vertices, end: Vertices, radius: float, around: int = 32) -> Triangles:
    """A round bar between two points."""
    axis = np.asarray(end, dtype=np.float64) - start
    axis /= np.linalg.norm(axis)
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    angle = np.arange(around) * 2 * math.pi / around
    ring = radius * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)
    return loft(np.stack([ring + start, ring + end]))


def ellipsoid(centre: tuple[float, float, float], radii: tuple[float, float, float]) -> Triangles:
    """An ellipsoid with its axes along x, y and z."""
    polar = np.linspace(math.pi - 0.02, 0.02, 13)
    angle = np.arange(20) * 2 * math.pi / 20
    rings = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(angle),
            np.sin(polar)[:, None] * np.sin(angle),
            np.broadcast_to(np.cos(polar)[:, None], (13, 20)),
        ],
        axis=-1,
    )
    return loft(rings * np.asarray(radii) + np.asarray(centre), smooth=True)


def pyramid(shape: Pyramid, course: float | None, seed: int) -> Triangles:
    """A square pyramid on z = 0; with a course height, of weathered steps instead of smooth faces.

    The steps lean back a little and are uneven by a quarter of their depth.
    """
    half = shape.base / 2
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    levels = 1 if course is None else max(1, round(shape.height / course))
    if levels == 1:
        rings = np.array([[half, 0.0], [half * 1e-4, shape.height]])
        corners = np.ones((2, 4))
    else:
        rng = np.random.default_rng(np.random.SeedSequence(seed))
        z = np.linspace(0.0, shape.height, levels + 1)
        ledge = half / levels
        foot = half * (1 - np.arange(levels) / levels)
        rings = np.empty((2 * levels, 2))
        rings[0::2] = np.stack([foot, z[:-1]], axis=1)
        rings[1::2] = np.stack([foot - 0.15 * ledge, z[1:]], axis=1)
        wear = 1 + 0.25 * ledge / foot[:, None] * rng.standard_normal((levels, 4))
        corners = np.repeat(wear, 2, axis=0)
    loops = np.empty((len(rings), 4, 3))
    loops[..., :2] = (rings[:, 0, None] * corners)[..., None] * square
    loops[..., 2] = rings[:, 1, None]
    return loft(loops)


def hills(shape: Hills) -> Triangles:
    """A ridge whose outline is a random walk through all scales, falling to the plain on both sides."""
    rng = np.random.default_rng(np.random.SeedSequence(shape.seed))
    columns, rows = 1024, 25  # odd: one row runs along the crest
    spread = math.radians(shape.spread)
    azimuth = math.radians(shape.azimuth) + np.linspace(-0.5, 0.5, columns) * spread
    across = np.linspace(-1.0, 1.0, columns)
    depth = np.linspace(-1.0, 1.0, rows)
    length = shape.distance * spread
    crest = _fractal(rng, columns, length / max(6 * shape.height, 1.0), 1.9)
    crest = 0.62 + 0.26 * crest
    envelope = np.ones(columns) if shape.spread > 350 else (1 - np.abs(across) ** 2.5) ** 0.8
    outline = np.maximum(envelope * crest, 0.0)
    outline *= shape.height / outline.max()
    # Gullies and spurs: the slope runs down unevenly, and the crest wanders in depth.
    relief = np.stack([_fractal(rng, columns, length / (2 * shape.height), 1.6) for _ in range(rows)])
    relief = (relief + np.roll(relief, 1, axis=0) + np.roll(relief, -1, axis=0)) / 3
    profile = np.maximum(0.0, 1 - np.abs(depth)) ** 1.3
    uneven = 1 + 0.35 * relief * (4 * profile * (1 - profile))[:, None]
    height = shape.base - 1.0 + (outline + 1.0) * profile[:, None] * uneven
    half_depth = min(3.0 * shape.height, 0.3 * shape.distance)
    radius = shape.distance + depth[:, None] * half_depth + np.zeros(columns)
    points = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=-1)
    return quad_strip(points[:, ::-1], smooth=True)


def _fractal(rng: np.random.Generator, count: int, waves: float, exponent: float) -> NDArray[np.float64]:
    """A smooth periodic curve of rms 1 with spectral amplitude (k² + waves²)^(−exponent/2)."""
    k = np.arange(1, count // 3)
    amplitude = (k**2 + max(waves, 2.0) ** 2) ** (-exponent / 2)
    spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
    spectrum[1 : count // 3] = amplitude * np.exp(2j * math.pi * rng.random(k.size))
    curve = np.fft.irfft(spectrum, count)
    return np.asarray(curve / curve.std())


def _grid_faces(rows: int, columns: int, closed: bool) -> Faces:
    i, k = np.meshgrid(np.arange(rows - 1), np.arange(columns if closed else columns - 1), indexing="ij")
    following = (k + 1) % columns
    a, b = i * columns + k, i * columns + following
    c, d = (i + 1) * columns + following, (i + 1) * columns + k
    return np.concatenate(
        [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)]
    )
