"""How a ray ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, final

import drjit as dr

__all__ = ["ESCAPED", "HIT", "NOT_TRACED", "OUT_OF_STEPS", "STOPPED", "RayEnd", "RayStatus"]


@final
class RayStatus(IntEnum):
    """Why a ray ended. `message` says it in words, with the remedy where there is one."""

    NOT_TRACED = 0
    HIT = 1
    ESCAPED = 2
    OUT_OF_STEPS = 3
    STOPPED = 4

    @property
    def label(self) -> str:
        """Name as it stands in reports: ``hit``, ``escaped``, ``out-of-steps``, …"""
        return self.name.lower().replace("_", "-")

    @property
    def message(self) -> str:
        """What happened to the ray."""
        return _MESSAGES[self]


_MESSAGES = {
    RayStatus.NOT_TRACED: "the ray was masked out",
    RayStatus.HIT: "the ray met a surface",
    RayStatus.ESCAPED: "the ray left the air volume and met nothing beyond",
    RayStatus.OUT_OF_STEPS: "the ray used up its steps; raise max_steps, or ask for less accuracy",
    RayStatus.STOPPED: "the ray went the whole distance that was asked for",
}

# The same as plain numbers, for comparison with status arrays.
NOT_TRACED: Final = int(RayStatus.NOT_TRACED)
HIT: Final = int(RayStatus.HIT)
ESCAPED: Final = int(RayStatus.ESCAPED)
OUT_OF_STEPS: Final = int(RayStatus.OUT_OF_STEPS)
STOPPED: Final = int(RayStatus.STOPPED)


@final
@dataclass
class RayEnd:
    """Where and how rays ended. One entry per ray, in the field's array types.

    Attributes
    ----------
    status : UInt32
        A `RayStatus`.
    position : Array3f, m
        HIT: the point on the surface. ESCAPED: where the ray left the volume (its origin, if it never met
        the volume). Otherwise where it stopped.
    direction : Array3f, 1
        Unit direction of travel there.
    chord_origin, chord_direction : Array3f, m and 1
        The last straight piece that was tested against the surface: a hit lies on it, so that a full
        intersection of this one piece finds it again.
    chord_length : Float, m
        Its length; infinite beyond the volume.
    chord_start : Float, m
        Length of the path before it.
    steps : UInt32
        Integration steps made (layers: boundaries met).
    path_length : Float, m
        Length of the path from the origin to `position`.
    optical_path : Float or None, m
        ∫ n ds along it. None unless details were asked for.
    turning_height : Float or None, m
        Least height at which the ray turned from falling to rising; NaN where it never did. None unless
        details were asked for.
    error : Float or None, rad
        Sum of the estimated errors of the steps, as a displacement seen from the origin. None for fixed
        steps and panes.
    queries : UInt32 or None
        Straight pieces that were tested against the surface.
    trial : Float or None, m
        Interval of σ that a controlled step would have tried next.
    mark : object or None
        What the surface says of the hit, where it says more than its distance.
    """

    status: Any
    position: Any
    direction: Any
    chord_origin: Any
    chord_direction: Any
    chord_length: Any
    chord_start: Any
    steps: Any
    path_length: Any
    optical_path: Any = None
    turning_height: Any = None
    error: Any = None
    queries: Any = None
    mark: Any = None
    trial: Any = None

    def replaced(self, later: RayEnd, active: Any) -> RayEnd:
        """The later end where rays are active, this one elsewhere; what either lacks is left out."""

        def choose(name: str) -> Any:
            mine, other = getattr(self, name), getattr(later, name)
            return None if mine is None or other is None else dr.select(active, other, mine)

        return RayEnd(**{name: choose(name) for name in RayEnd.__dataclass_fields__})

    @property
    def hit(self) -> Any:
        """Whether the ray met a surface (Bool)."""
        return self.status == HIT

    @property
    def escaped(self) -> Any:
        """Whether the ray left the volume and met nothing (Bool)."""
        return self.status == ESCAPED


def choose_status(types: Any, active: Any, hit: Any, escaped: Any, stopped: Any) -> Any:
    """The status array (UInt32) from masks; what is in none of them has run out of steps."""
    UInt32 = types.UInt32
    status = dr.select(stopped, UInt32(STOPPED), UInt32(OUT_OF_STEPS))
    status = dr.select(escaped, UInt32(ESCAPED), status)
    status = dr.select(hit, UInt32(HIT), status)
    return dr.select(active, status, UInt32(NOT_TRACED))
