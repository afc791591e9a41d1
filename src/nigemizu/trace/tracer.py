"""How light travels, as it stands in a scene file."""

from __future__ import annotations

from typing import Literal, final

from pydantic import Field as Described

from nigemizu.values import Value

__all__ = ["Tracer"]


@final
class Tracer(Value):
    """How light travels through the air of a scene."""

    method: Literal["bent", "straight", "layered"] = Described(
        "bent",
        description="bent: through the refractive-index volume; straight: no refraction; "
        "layered: through panes of constant index (Berger et al. 1990)",
    )
    step: float = Described(
        1.0, gt=0, description="interval along the ray between turns", json_schema_extra={"unit": "m"}
    )
    max_steps: int = Described(5000, ge=1, description="most intervals (layered: panes) per ray")
    stepper: Literal["euler", "leapfrog", "yoshida4", "suzuki4"] = Described(
        "leapfrog",
        description="integration rule; euler is the paper's, of first order, leapfrog of second, "
        "yoshida4 and suzuki4 of fourth",
    )
    chord_tolerance: float = Described(
        0.1,
        ge=0,
        le=1,
        description="how far a straight piece that is tested against objects may lie from the bent ray, "
        "fraction of a pixel; 0 tests after every interval",
    )
    beyond: Literal["straight", "extend"] = Described(
        "straight",
        description="air beyond the sides of the volume; straight: no bending there, "
        "extend: the outermost columns continue",
    )
    layers: int = Described(40, ge=2, le=100_000, description="layered: number of panes")
    layer_spacing: Literal["equal-index", "equal-height"] = Described(
        "equal-index",
        description="layered: panes with equal jumps of the index between them, or of equal thickness",
    )
    waviness_amplitude: float = Described(
        0.0,
        ge=0,
        description="layered: rms height of the waves on the panes",
        json_schema_extra={"unit": "m"},
    )
    waviness_length: float = Described(
        1.0, gt=0, description="layered: wavelength of the waves", json_schema_extra={"unit": "m"}
    )
    waviness_seed: int = Described(0, ge=0, description="layered: seed of the waves")
