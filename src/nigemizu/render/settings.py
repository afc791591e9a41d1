"""The properties of the integrator plug-in, validated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, final

from pydantic import Field, ValidationError

from nigemizu.errors import InputError
from nigemizu.trace import Tracer
from nigemizu.values import Value, nearest

__all__ = ["Settings", "read_settings"]


@final
class Settings(Value):
    """How the integrator follows light; as a plug-in it also takes the fields of `nigemizu.trace.Tracer`.

    Parameters
    ----------
    air : str, optional
        Path of an air dataset (netCDF or Zarr), or a name that the registered resolver knows. None: no air.
    time : float, s
        Instant of the air.
    tracer : Tracer
        How light travels.
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
    time: float = Field(0.0, json_schema_extra={"unit": "s"})
    tracer: Tracer = Tracer()
    max_depth: Annotated[int, Field(ge=-1)] = 3
    rr_depth: Annotated[int, Field(ge=1)] = 5
    hide_emitters: bool = False
    visibility: Annotated[float, Field(gt=0)] | None = Field(None, json_schema_extra={"unit": "m"})


def read_settings(given: Mapping[str, Any]) -> Settings:
    """Check the flat plug-in properties `given`, or raise `InputError` naming the first bad one."""
    own = [name for name in Settings.model_fields if name != "tracer"]
    known = (*own, *Tracer.model_fields, "to_world")
    for key in given:
        if key not in known:
            raise InputError(
                f"unknown property {key!r}", key="integrator nigemizu", remedy=nearest(key, known)
            )
    nested = {key: value for key, value in given.items() if key in own}
    nested["tracer"] = {key: value for key, value in given.items() if key in Tracer.model_fields}
    try:
        return Settings.model_validate(nested)
    except ValidationError as error:
        first = error.errors()[0]
        # The door of `Value` reports the key itself, pydantic the place.
        context = first.get("ctx", {})
        key = str(context.get("key", first["loc"][-1] if first["loc"] else ""))
        problem = first["msg"][:1].lower() + first["msg"][1:]
        raise InputError(
            problem,
            key=f"integrator nigemizu: {key}",
            value=context.get("given", first["input"]),
            expected=context.get("expected"),
        ) from None
