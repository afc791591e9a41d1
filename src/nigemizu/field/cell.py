"""A piece of a field in which one smooth formula holds: what one step of a ray may rely on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, final

import drjit as dr

__all__ = ["Cell"]


@final
class Cell:
    """A piece of a field in which one smooth formula holds, one entry per ray.

    Attributes
    ----------
    value_and_gradient : callable
        Maps a position (Array3f, m) to the index (Float, 1) and its gradient (Array3f, 1/m). The formula
        goes on smoothly a little beyond the piece.
    lower, upper : Array3f or None, m
        Corners of the piece; entries may be infinite. None: the piece has no bounds.
    reach : Float or None, m
        The longest step from here that can overlook nothing of the field. None: no limit.

    Notes
    -----
    A cell is made anew for every step of a symbolic loop; it must not be carried from one to the next.
    """

    # Not a dataclass: Dr.Jit would take it for a part of the state of loops that mention it.

    __slots__ = ("lower", "reach", "upper", "value_and_gradient")

    def __init__(
        self,
        value_and_gradient: Callable[[Any], tuple[Any, Any]],
        lower: Any = None,
        upper: Any = None,
        reach: Any = None,
    ) -> None:
        self.value_and_gradient = value_and_gradient
        self.lower = lower
        self.upper = upper
        self.reach = reach

    def exit(self, position: Any, direction: Any) -> Any:
        """Distance to the faces ahead along a straight line.

        Parameters
        ----------
        position : Array3f, m
        direction : Array3f, 1

        Returns
        -------
        distance : Float or float — in units of ``direction``'s length, not negative; infinite where no
            face lies ahead
        """
        distance: Any = dr.inf
        if self.lower is None:
            return distance
        for axis in range(3):
            d = direction[axis]
            face = dr.select(d > 0, self.upper[axis], self.lower[axis])
            ahead = (face - position[axis]) / dr.select(d == 0, 1, d)
            distance = dr.minimum(distance, dr.select(d == 0, dr.inf, ahead))
        return dr.maximum(distance, 0)
