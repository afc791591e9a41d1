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
    accuracy: float = Described(
        0.1,
        gt=0,
        description="largest displacement in the picture that the computation may add to that of the air; "
        "the intervals along the ray follow from it",
    )
    accuracy_unit: Literal["pixel", "radian"] = Described(
        "pixel", description="what accuracy counts: pixels of the picture, or radians seen from the eye"
    )
    step: float | None = Described(
        None,
        gt=0,
        description="fixed interval along the ray between turns, as in the paper, in place of the accuracy",
        json_schema_extra={"unit": "m"},
    )
    max_steps: int = Described(
        20_000, ge=1, description="most intervals (layered: panes) per ray; rays that need more are counted"
    )
    stepper: Literal["euler", "leapfrog", "yoshida4", "suzuki4"] = Described(
        "leapfrog",
        description="integration rule of fixed intervals; euler is the paper's, of first order, leapfrog of "
        "second, yoshida4 and suzuki4 of fourth",
    )
    interpolation: Literal["trilinear", "stratified", "tricubic"] = Described(
        "stratified",
        description="index between the nodes; trilinear: the paper's; stratified: a smooth spline in height, "
        "linear across; tricubic: splines in all directions, several times slower",
    )
    precision: Literal["auto", "single", "double"] = Described(
        "auto",
        description="of positions and of the volume; auto: single for pictures, double for rays as data",
    )
    sharing: bool = Described(
        True,
        description="whether the rays of a picture share paths where these differ smoothly, "
        "within the accuracy",
    )
    chord_tolerance: float = Described(
        0.01,
        ge=0,
        le=1,
        description="how far a straight piece that is tested against objects may lie from the bent ray, "
        "fraction of a pixel; 0 tests after every interval. Rays that graze a hot ground lie closer to each "
        "other than pixels elsewhere: at 0.05 the vanishing line is a pixel low",
    )
    beyond: Literal["straight", "extend", "mean"] = Described(
        "straight",
        description="air beyond the sides of the volume; straight: no bending there, "
        "extend: the outermost columns continue, for 20 km where the air is uneven; mean: so does its "
        "horizontal mean, for uneven air whose outermost eddies would be drawn out",
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

    def angle(self, pixel_angle: float) -> float:
        """The accuracy as an angle [rad], where a pixel spans `pixel_angle` [rad]."""
        return self.accuracy * (pixel_angle if self.accuracy_unit == "pixel" else 1.0)
