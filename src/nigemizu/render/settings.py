"""The properties of the integrator plug-in, validated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, final

from pydantic import Field, ValidationError

from nigemizu.errors import InputError
from nigemizu.values import Value, nearest

__all__ = ["Settings", "read_settings"]


@final
class Settings(Value):
    """How the integrator follows light.

    Parameters
    ----------
    air : str, optional
        Path of an air dataset (netCDF or Zarr), or a name that the registered resolver knows. None: no air.
    time : float, s
        Instant of the air.
    method : {"bent", "straight", "layered"}
        Curved rays through the volume, straight rays, or panes of constant index (Berger et al. 1990).
    step : float, m
        Length of one integration step.
    max_steps : int
        Steps after which a ray goes straight on (and is counted).
    chord_tolerance : float, rad
        Several steps share one chord that is tested against geometry while the curve stays this close
        to it, seen from the eye; a fraction of the angle of a pixel.
    beyond : {"straight", "extend"}
        Outside the sides of the volume: no bending, or the air of the edge goes on.
    max_depth : int
        Longest path, in segments: 1 shows emitters only, 2 adds direct light, -1 is unlimited.
    rr_depth : int
        Path length from which Russian roulette may end a path.
    hide_emitters : bool
        Whether the camera looks through emitters.
    visibility : float, m, optional
        Meteorological range of the haze (Koschmieder); None: no haze.
    """

    air: str | None = None
    time: float = 0.0
    method: Literal["bent", "straight", "layered"] = "bent"
    step: Annotated[float, Field(gt=0)] = 2.0
    max_steps: Annotated[int, Field(ge=1, le=2**31)] = 20_000
    chord_tolerance: Annotated[float, Field(ge=0)] = 2e-5
    beyond: Literal["straight", "extend"] = "straight"
    layers: Annotated[int, Field(ge=1, le=4096)] = 40
    max_depth: Annotated[int, Field(ge=-1)] = 3
    rr_depth: Annotated[int, Field(ge=1)] = 5
    hide_emitters: bool = False
    visibility: Annotated[float, Field(gt=0)] | None = None


def read_settings(given: Mapping[str, Any]) -> Settings:
    """Check the plug-in properties `given`, or raise `InputError` naming the first bad one."""
    known = (*Settings.model_fields, "to_world")
    for key in given:
        if key not in known:
            raise InputError(
                f"unknown property {key!r}", key="integrator nigemizu", remedy=nearest(key, known)
            )
    try:
        return Settings.model_validate(dict(given))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        problem = first["msg"][0].lower() + first["msg"][1:]
        raise InputError(problem, key=f"integrator nigemizu: {key}", value=first["input"]) from None
