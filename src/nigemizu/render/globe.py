"""The round Earth behind the flat map in which rays are followed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, final

import drjit as dr

__all__ = ["Globe"]


@final
@dataclass(frozen=True)
class Globe:
    """Leads from the map back to the world as the eye sees it.

    In the map, x and y are distances along the surface of the sea, z is the conformal height
    (`nigemizu.air.Earth`), and a ray makes the same angle with the vertical as in the world. The eye's own
    axes have their origin in the eye's place on the map and their z along the vertical there.

    Parameters
    ----------
    radius : float, m
        Of the Earth.
    eye : (x, y, z) float, m
        In the map.
    top : float, m
        Conformal height at which the air ends.

    Notes
    -----
    Exact for air in layers, whose rays stay in vertical planes through the eye.
    """

    radius: float
    eye: tuple[float, float, float]
    top: float

    def outward(self, position: Any, direction: Any) -> Any:
        """Direction in the eye's axes of light that has left the air.

        Parameters
        ----------
        position : Array3f, m
        direction : Array3f, 1
            Both in the map, at the top of the air or on the straight line with which a ray goes on there.

        Returns
        -------
        Array3f, 1
            Turned down by the angle between the verticals, the distance over the radius.
        """
        Float, Array3f = type(position.x), type(direction)
        # Above the air the map's lines are not those of the world: back to its top.
        above = dr.maximum(position.z - Float(self.top), 0) / dr.maximum(direction.z, 1e-6)
        x = position.x - direction.x * above - Float(self.eye[0])
        y = position.y - direction.y * above - Float(self.eye[1])
        distance = dr.sqrt(dr.fma(x, x, y * y))
        inverse = dr.rcp(dr.maximum(distance, 1e-6))
        x, y = x * inverse, y * inverse
        sine, cosine = dr.sincos(distance * Float(1 / self.radius))
        along = dr.fma(direction.x, x, direction.y * y)
        across = dr.fma(direction.y, x, -(direction.x * y))
        # The plane of the ray holds the vertical of the eye: what is across it does not turn.
        forward = dr.fma(cosine, along, sine * direction.z)
        up = dr.fma(cosine, direction.z, -(sine * along))
        return Array3f(forward * x - across * y, forward * y + across * x, up)

    def towards(self, position: Any) -> Any:
        """Direction in the eye's axes in which a point of the map would be seen without air (unit length)."""
        Float, Array3f = type(position.x), type(position)
        x, y = position.x - Float(self.eye[0]), position.y - Float(self.eye[1])
        distance = dr.sqrt(dr.fma(x, x, y * y))
        inverse = dr.rcp(dr.maximum(distance, 1e-6))
        half = distance * Float(0.5 / self.radius)
        sine = dr.sin(2 * half)
        # r/R of eye and point, without losing the difference: e^(z/R) = 1 + h/R
        eye = Float(math.exp(self.eye[2] / self.radius))
        point = dr.exp(position.z * Float(1 / self.radius))
        rise = eye * _expm1((position.z - Float(self.eye[2])) * Float(1 / self.radius))
        drop = 2 * dr.square(dr.sin(half))  # 1 − cos
        up, forward = rise - point * drop, point * sine
        return dr.normalize(Array3f(forward * x * inverse, forward * y * inverse, up))


def _expm1(value: Any) -> Any:
    """e^x − 1 of small numbers, by its series."""
    return value * (1 + value * (1 / 2 + value * (1 / 6 + value * (1 / 24 + value / 120))))
