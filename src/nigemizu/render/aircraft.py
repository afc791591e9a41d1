"""The shape of an airliner with two engines, by lofting: right to the eye from 300 m, no nearer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from nigemizu.render.meshes import Triangles, box, cylinder, ellipsoid, loft, merged, quad_strip

__all__ = ["LENGTH", "NOZZLES", "airliner"]

LENGTH: Final = 37.6  # m, from nose to tail of the airliner below
NOZZLES: Final = ((0.3, 5.75, 1.75), (0.3, -5.75, 1.75))
"""Middles of the jet pipes (x, y, z) [m]; the jets leave towards −x."""

Points = NDArray[np.float64]

# x, radius, height of the axis of the fuselage, from the tail to the nose (m)
_FUSELAGE: Final = np.array([
    [-18.80, 0.16, 4.95], [-18.0, 0.34, 4.88], [-16.0, 0.74, 4.66], [-13.5, 1.20, 4.36], [-11.0, 1.60, 4.08],
    [-8.5, 1.86, 3.88], [-6.0, 1.97, 3.78], [-2.0, 1.98, 3.75], [6.0, 1.98, 3.75], [12.0, 1.98, 3.75],
    [14.2, 1.93, 3.71], [15.8, 1.74, 3.60], [17.0, 1.40, 3.44], [17.9, 0.98, 3.28], [18.5, 0.55, 3.15],
    [18.78, 0.18, 3.08],
])  # fmt: skip
# y, leading edge x, chord, z, thickness over chord of the left wing, from the root to the tip (m)
_WING: Final = np.array([
    [1.2, 4.5, 6.6, 2.62, 0.13], [6.4, 1.6, 3.9, 2.98, 0.12], [16.2, -3.6, 1.75, 3.85, 0.11],
    [16.9, -4.2, 1.2, 3.95, 0.10],
])  # fmt: skip
_WINGLET: Final = np.array([[16.85, -4.2, 1.25, 3.93, 0.08], [17.05, -5.0, 0.6, 6.0, 0.08]])
_STABILISER: Final = np.array([[0.3, -13.6, 3.6, 4.75, 0.10], [6.2, -16.9, 1.5, 5.35, 0.09]])
# z, leading edge x, chord of the fin (m)
_FIN: Final = np.array([[5.0, -11.2, 6.3], [6.2, -12.6, 5.2], [11.7, -16.5, 2.3]])
# x, radius of the nacelle and of the core behind it, from the rear to the front (m)
_NACELLE: Final = np.array([
    [1.55, 0.84], [2.4, 0.98], [3.4, 1.10], [4.4, 1.15], [5.2, 1.12], [5.7, 1.03], [5.85, 0.94],
])  # fmt: skip
_CORE: Final = np.array([[0.3, 0.34], [0.9, 0.46], [1.6, 0.6]])
_ENGINE: Final = (5.75, 1.75)  # y, z of its axis (m)
_WINDOWS: Final = np.arange(-6.4, 13.3, 0.53)  # x of the cabin's (m)


def airliner() -> dict[str, list[Triangles]]:
    """Meshes of the airliner by material: paint, fin, grey, metal, dark, glass, rubber, lamp.

    Its middle stands over the origin, its front looks along +x.
    """
    left = [_lofted(_WING), _lofted(_WINGLET), _lofted(_STABILISER)]
    engines = _engine()
    gear = _gear()
    return {
        "paint": [_turned(_FUSELAGE[:, :2], _FUSELAGE[:, 2])],
        "fin": [_fin(), *_both(engines["cowl"]), *_both(left[1:2])],
        "grey": [*_both([left[0], left[2], *engines["pylon"]]), _belly()],
        "metal": [*_both(engines["core"]), *gear["legs"]],
        "dark": [*_both(engines["intake"]), merged([*_both(_side_windows())])],
        "glass": _cockpit(),
        "rubber": gear["wheels"],
        "lamp": gear["lamps"],
    }


def _both(parts: Sequence[Triangles]) -> list[Triangles]:
    """The parts of the left side, and their mirror images."""
    return [image for part in parts for image in (part, _mirrored(part))]


def _mirrored(part: Triangles) -> Triangles:
    return replace(part, vertices=part.vertices * np.array([1.0, -1.0, 1.0]), faces=part.faces[:, ::-1])


def _turned(profile: Points, height: Points, y: float = 0.0) -> Triangles:
    """A body of revolution about an axis along x, which may bend: (x, radius) from the rear to the front."""
    angle = np.arange(36) * 2 * math.pi / 36
    x, radius = (column[:, None] for column in profile.T)
    across = y + radius * np.cos(angle)
    up = height[:, None] + radius * np.sin(angle)
    return loft(np.stack([np.broadcast_to(x, across.shape), across, up], axis=-1), smooth=True)


def _section(chord: Points, thickness: Points) -> tuple[Points, Points]:
    """Wing sections in turn from the leading edge over the upper side: distance behind it, height."""
    angle = np.arange(24) * 2 * math.pi / 24
    behind = 0.5 - 0.5 * np.cos(angle)
    # thickest at three tenths of the chord, sharp at the rear
    half = 1.3 * np.sqrt(behind) * (1 - behind) * np.sign(np.sin(angle))
    return chord[:, None] * behind, (chord * thickness)[:, None] * half


def _lofted(table: Points) -> Triangles:
    """A wing on the left side."""
    y, front, chord, height, thickness = table.T
    behind, up = _section(chord, thickness)
    x, z = front[:, None] - behind, height[:, None] + up
    return loft(np.stack([x, np.broadcast_to(y[:, None], x.shape), z], axis=-1)[:, ::-1])


def _fin() -> Triangles:
    z, front, chord = _FIN.T
    behind, across = _section(chord, np.full(len(z), 0.1))
    x = front[:, None] - behind
    return loft(np.stack([x, across, np.broadcast_to(z[:, None], x.shape)], axis=-1))


def _belly() -> Triangles:
    """The fairing between the wings."""
    return ellipsoid((0.2, 0.0, 2.35), (6.2, 1.9, 0.85))


def _engine() -> dict[str, list[Triangles]]:
    y, z = _ENGINE
    axis = np.array([0.0, y, z])
    front, along = float(_NACELLE[-1, 0]), np.array([1.0, 0.0, 0.0])
    low, high = y - 0.16, y + 0.16
    pylon = np.array([
        [[5.0, low, z + 1.0], [5.0, high, z + 1.0], [1.0, high, z + 0.5], [1.0, low, z + 0.5]],
        [[2.4, low, 3.1], [2.4, high, 3.1], [-0.4, high, 2.9], [-0.4, low, 2.9]],
    ])  # fmt: skip
    return {
        "cowl": [_turned(_NACELLE, np.full(len(_NACELLE), z), y)],
        "core": [_turned(_CORE, np.full(len(_CORE), z), y)],
        # a hand in front of the cowl's flat end and behind that of the core
        "intake": [
            cylinder(axis + (front - 0.02) * along, axis + (front + 0.02) * along, 0.86),
            cylinder(axis + 0.28 * along, axis + 0.32 * along, 0.27),
        ],
        "pylon": [loft(pylon)],
    }


def _side_windows() -> list[Triangles]:
    """Of the left side, a finger outside the skin."""
    height = 0.45
    y = 1.98 * math.cos(math.asin(height / 1.98))
    return [box((0.24, 0.05, 0.34)).moved((x, y, 3.75 + height - 0.17)) for x in _WINDOWS]


def _cockpit() -> list[Triangles]:
    """Panes around the nose, a finger outside the skin."""
    panes = []
    for low, high in (
        (24.0, 43.0),
        (46.0, 66.0),
        (69.0, 88.0),
        (92.0, 111.0),
        (114.0, 134.0),
        (137.0, 156.0),
    ):
        angle = np.radians(np.linspace(low, high, 5))
        rows = []
        for x in (16.35, 16.75, 17.1):
            radius = np.interp(x, _FUSELAGE[:, 0], _FUSELAGE[:, 1]) + 0.03
            middle = np.interp(x, _FUSELAGE[:, 0], _FUSELAGE[:, 2])
            rows.append(
                np.stack([np.full(5, x), radius * np.cos(angle), middle + radius * np.sin(angle)], axis=-1)
            )
        panes.append(quad_strip(np.stack(rows)))
    return panes


def _gear() -> dict[str, list[Triangles]]:
    legs, wheels = [], []
    for x, y, radius, width, top in (
        (12.4, 0.0, 0.38, 0.22, 2.2), (-1.3, 3.8, 0.58, 0.42, 2.7), (-1.3, -3.8, 0.58, 0.42, 2.7),
    ):  # fmt: skip
        legs.append(cylinder(np.array([x, y, radius]), np.array([x, y, top]), 0.3 * radius, around=12))
        for side in (-1.0, 1.0):
            inner, outer = y + 0.1 * side, y + (0.1 + width) * side
            wheels.append(cylinder(np.array([x, inner, radius]), np.array([x, outer, radius]), radius))
    lamps = _both([ellipsoid((12.75, 0.22, 1.45), (0.1, 0.13, 0.13))])
    return {"legs": legs, "wheels": wheels, "lamps": lamps}
