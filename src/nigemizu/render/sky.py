"""Sun and sky as an image of the whole sphere and one direction, closed at the horizon."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from nigemizu.render.light import Light

__all__ = ["Sky", "bake", "baked_table"]

_ROWS: Final = 1024
_COLUMNS: Final = 1024
_SUN_RADIUS: Final = math.radians(0.5358 / 2)  # of the solar disc in the model's default
_GRADIENT_SUN: Final = 3.0  # horizontal irradiance of the teaching sun over that of its sky


@final
@dataclass(frozen=True)
class Sky:
    """Light from afar.

    Parameters
    ----------
    radiance : (1024, 1024, 3) float32
        Rows from the zenith to the nadir; columns by azimuth, in the layout of Mitsuba's ``envmap``. Below
        the horizon it repeats the horizon's colour.
    sun_direction : (3,) float64
        Unit vector towards the sun.
    sun_irradiance : (3,) float64
        On a surface that faces the sun.
    """

    radiance: NDArray[np.float32]
    sun_direction: NDArray[np.float64]
    sun_irradiance: NDArray[np.float64]

    def emitters(self) -> dict[str, Any]:
        """Mitsuba dictionaries of the sky and, if it shines, the sun."""
        found: dict[str, Any] = {
            "sky": {
                "type": "envmap",
                "bitmap": mi.Bitmap(self.radiance),
                "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 90),
            }
        }
        if np.any(self.sun_irradiance > 0):
            found["sun"] = {
                "type": "directional",
                "direction": (-self.sun_direction).tolist(),
                "irradiance": {"type": "rgb", "value": self.sun_irradiance.tolist()},
            }
        return found


def bake(light: Light) -> Sky:
    """The sky of `light`, scaled so that sun and sky light a horizontal white surface to radiance 1.

    Notes
    -----
    The disc of the sun is not drawn: it is a direction without extent, with sharp shadows. Mitsuba's own
    sky model is black below its horizon; there the colour of the horizon is repeated, so that ground that
    ends far away closes with the sky without a dark stripe.

    References
    ----------
    L. Hošek and A. Wilkie, An analytic model for full spectral sky-dome radiance, 2012,
    doi:10.1145/2185520.2185591
    """
    azimuth, elevation = math.radians(light.sun_azimuth), math.radians(light.sun_elevation)
    towards = np.array(
        [
            math.cos(elevation) * math.cos(azimuth),
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
        ]
    )
    polar = (np.arange(_ROWS) + 0.5) * math.pi / _ROWS
    around = (np.arange(_COLUMNS) + 0.5) * 2 * math.pi / _COLUMNS
    # Rows below the horizon look along the lowest row above it.
    polar_seen = np.minimum(polar, polar[_ROWS // 2 - 1])
    up = np.cos(polar_seen)
    solid_angle = np.sin(polar) * (math.pi / _ROWS) * (2 * math.pi / _COLUMNS)
    above = polar < math.pi / 2
    if light.sky == "sunsky":
        level = np.sin(polar_seen)
        directions = np.stack(
            [
                level[:, None] * np.sin(around),
                level[:, None] * np.cos(around),
                np.broadcast_to(up[:, None], (_ROWS, _COLUMNS)),
            ],
            axis=-1,
        )
        radiance, sun = _clear_sky(light, towards, directions)
    else:
        mix = (up**0.5)[:, None] if light.sky == "gradient" else np.zeros((_ROWS, 1))
        rows = (1 - mix) * np.array(light.horizon_colour) + mix * np.array(light.zenith_colour)
        radiance = np.repeat(rows[:, None, :], _COLUMNS, axis=1) * light.sky_scale
        from_sky = float(np.einsum("ijk,i->", radiance[above], (solid_angle * up)[above]) / 3)
        strength = _GRADIENT_SUN * light.sun_scale * from_sky / towards[2] if light.sky == "gradient" else 0.0
        sun = np.full(3, strength)
    luminance = np.array([0.2126, 0.7152, 0.0722])
    from_sky = float(np.einsum("ijk,i,k->", radiance[above], (solid_angle * up)[above], luminance))
    total = from_sky + float(sun @ luminance) * towards[2]
    scale = math.pi / total if total > 0 else 1.0
    return Sky(np.asarray(radiance * scale, dtype=np.float32), towards, sun * scale)


def baked_table(
    table: NDArray[np.float64],
    elevation: NDArray[np.float64],
    sun_azimuth: float,
    sun_direction: NDArray[np.float64],
    sun_irradiance: NDArray[np.float64],
) -> Sky:
    """A sky from a table.

    Parameters
    ----------
    table : (E, A, 3) float64
        Radiance at the elevations, and at azimuths from the Sun that are π (j/(A − 1))².
    elevation : (E,) float64, rad
        Increasing, up to the zenith.
    sun_azimuth : float, rad
    sun_direction, sun_irradiance : (3,) float64
        As of `Sky`.
    """
    rows, columns = table.shape[:2]
    polar = (np.arange(_ROWS) + 0.5) * math.pi / _ROWS
    around = (np.arange(_COLUMNS) + 0.5) * 2 * math.pi / _COLUMNS
    seen = np.maximum(math.pi / 2 - polar, max(elevation[0], 1e-3))  # the horizon, repeated below
    row = np.interp(seen, elevation, np.arange(rows))
    # Columns run against the azimuth from +y, as in the layout of an ``envmap`` that is turned upright.
    turn = math.pi / 2 - around - sun_azimuth
    turn = np.abs(turn - 2 * math.pi * np.round(turn / (2 * math.pi)))
    column = np.sqrt(turn / math.pi) * (columns - 1)
    i, j = np.minimum(row.astype(int), rows - 2), np.minimum(column.astype(int), columns - 2)
    u, v = (row - i)[:, None, None], (column - j)[None, :, None]
    corner = [table[i + a][:, j + b] for a in (0, 1) for b in (0, 1)]
    radiance = (1 - u) * ((1 - v) * corner[0] + v * corner[1]) + u * ((1 - v) * corner[2] + v * corner[3])
    return Sky(np.asarray(np.maximum(radiance, 0), dtype=np.float32), sun_direction, sun_irradiance)


def _clear_sky(
    light: Light, towards: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Radiance of the Hošek–Wilkie sky in `directions`, and its sun's irradiance."""

    def evaluate(wanted: NDArray[np.float64], sun_scale: float, sky_scale: float) -> NDArray[np.float64]:
        model = mi.load_dict(
            {
                "type": "sunsky",
                "turbidity": light.turbidity,
                "albedo": light.ground_albedo,
                "sun_direction": towards.tolist(),
                "sun_scale": sun_scale,
                "sky_scale": sky_scale,
            }
        )
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi = -mi.Vector3f(wanted.reshape(-1, 3).T)
        return np.array(model.eval(si), dtype=np.float64).T.reshape(wanted.shape)

    # The mean over rings of the disc gives its irradiance.
    tangent = np.cross(towards, [0.0, 1.0, 0.0])
    tangent /= np.linalg.norm(tangent)
    bitangent = np.cross(towards, tangent)
    ring = np.sqrt((np.arange(8) + 0.5) / 8)[:, None] * math.sin(_SUN_RADIUS)
    angle = (np.arange(16) * 2 * math.pi / 16)[None, :]
    disc = (
        towards + (ring * np.cos(angle))[..., None] * tangent + (ring * np.sin(angle))[..., None] * bitangent
    )
    disc /= np.linalg.norm(disc, axis=-1, keepdims=True)
    sun = evaluate(disc, 1.0, 0.0).mean(axis=(0, 1)) * math.pi * math.sin(_SUN_RADIUS) ** 2
    return evaluate(directions, 0.0, 1.0) * light.sky_scale, sun * light.sun_scale
