"""What the ray diagram shows: rays, objects and air from the side, and where the ground vanishes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["DiagramRay", "Kind", "Outline", "Profile", "vanishing_line"]

FloatArray: TypeAlias = NDArray[np.float64]
Kind: TypeAlias = Literal["turned", "direct", "sky", "lost"]


@final
@dataclass(frozen=True, eq=False)
class DiagramRay:
    """A ray as a polyline from the eye.

    Parameters
    ----------
    x : (n,) float64, m
        Distances.
    z : (n,) float64, m
        Heights.
    status : {"hit", "escaped", "out-of-steps"}
        How the ray ended.
    """

    x: FloatArray
    z: FloatArray
    status: str

    def kind(self) -> Kind:
        """``"turned"`` when the ray came down and went up again; otherwise by its end."""
        lowest = int(np.argmin(self.z))
        span = float(np.ptp(self.z))
        if 0 < lowest < self.z.size - 1 and self.z[-1] > self.z[lowest] + 1e-6 * span:
            return "turned"
        return {"hit": "direct", "escaped": "sky"}.get(self.status, "lost")  # type: ignore[return-value]


@final
@dataclass(frozen=True, eq=False)
class Outline:
    """The silhouette of an object from the side.

    Parameters
    ----------
    name : str
    x, z : (n,) float64, m
        Corners in order.
    """

    name: str
    x: FloatArray
    z: FloatArray


@final
@dataclass(frozen=True, eq=False)
class Profile:
    """The air over one place.

    Parameters
    ----------
    height : (n,) float64, m
    refractivity : (n,) float64, 1
        n − 1.
    temperature : (n,) float64, K, optional
    """

    height: FloatArray
    refractivity: FloatArray
    temperature: FloatArray | None = None


def vanishing_line(rays: Sequence[DiagramRay], *, samples: int = 400) -> tuple[FloatArray, FloatArray]:
    """Lowest height that can be seen at each distance: the lower envelope of a dense bundle of rays.

    Parameters
    ----------
    rays : sequence of DiagramRay
        From one eye, with elevations close together.
    samples : int
        Distances at which the envelope is taken.

    Returns
    -------
    x : (m,) ndarray of float64, m
    z : (m,) ndarray of float64, m
        From the distance where the ground disappears to the end of the rays; both empty when the ground is
        seen to the end.

    Notes
    -----
    Limits: the envelope of a finite bundle, above the true line by as much as neighbouring rays are apart.
    """
    grounded = [ray for ray in rays if ray.status == "hit" and ray.z[-1] <= 1e-3 * ray.z[0]]
    others = [ray for ray in rays if not any(ray is other for other in grounded)]
    if not others:
        return np.empty(0), np.empty(0)
    begin = max(float(ray.x[-1]) for ray in grounded) if grounded else float(others[0].x[0])
    distances = np.linspace(begin, max(float(ray.x[-1]) for ray in others), samples)
    heights = np.array([np.interp(distances, ray.x, ray.z, left=np.inf, right=np.inf) for ray in others])
    lowest, nearest = heights.min(axis=0), heights.argmin(axis=0)
    # Where the lowest ray meets an object the line ends; what is higher up goes on, but limits nothing.
    stopped = ~np.isfinite(heights[nearest[:-1], np.arange(1, samples)])
    length = int(np.argmax(stopped)) + 1 if stopped.any() else samples
    # Up to where the limiting ray comes down the ground is seen; there the line begins.
    place = np.arange(samples)
    seen = np.isfinite(lowest) & (place < length) & (place >= int(np.argmin(lowest[:length])))
    return distances[seen], lowest[seen]
