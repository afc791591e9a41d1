"""Objects that a scene can hold: where they stand, how large they are, of what they are made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, final

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from nigemizu.render.light import Reflectance
from nigemizu.render.materials import Asphalt, Colour, Masonry, Material, Sand
from nigemizu.values import Value, nearest

__all__ = [
    "Aircraft",
    "Box",
    "Ground",
    "Hills",
    "Mesh",
    "MitsubaFile",
    "Object",
    "Pole",
    "Pyramid",
    "Road",
    "Sphere",
    "Vehicle",
]

Length = Annotated[float, Field(gt=0, json_schema_extra={"unit": "m"})]
Coordinate = Annotated[float, Field(json_schema_extra={"unit": "m"})]
Degrees = Annotated[float, Field(ge=-360, le=360, json_schema_extra={"unit": "degree"})]


def _read_place(given: Any) -> Any:
    """A place told by distance, bearing and height, as coordinates."""
    if not isinstance(given, Mapping):
        return given
    known = ("distance", "bearing", "height")
    for key in given:
        if key not in known:
            raise PydanticCustomError(
                "unknown_key", "unknown key", {"key": str(key), "remedy": nearest(str(key), known)}
            )
    if "distance" not in given:
        raise PydanticCustomError("wrong_type", "is missing", {"key": "distance", "expected": "metres"})
    place = Place.model_validate(dict(given))
    turn = math.radians(place.bearing)
    return place.distance * math.sin(turn), place.distance * math.cos(turn), place.height


@final
class Place(Value):
    """Where something stands, as seen from x = y = 0.

    Parameters
    ----------
    distance : float, m
        Along the ground.
    bearing : float, degrees
        By compass: 0 = +y (north), 90 = +x (east).
    height : float, m
    """

    distance: Annotated[float, Field(ge=0, json_schema_extra={"unit": "m"})]
    bearing: Annotated[float, Field(ge=-360, le=360, json_schema_extra={"unit": "degree"})] = 90.0
    height: Annotated[float, Field(json_schema_extra={"unit": "m"})] = 0.0


Position = Annotated[
    tuple[float, float, float],
    BeforeValidator(_read_place, json_schema_input_type=tuple[float, float, float] | Place),
    Field(json_schema_extra={"unit": "m"}),
]
"""(x, y, z), or ``{ distance, bearing, height }``, the bearing by compass: 0 = +y (north), 90 = +x (east)."""


@final
class Road(Value):
    """A straight road along +x, from behind the camera to the horizon.

    Parameters
    ----------
    centre : float, m
        y of the centre line.
    width : float, m
        Width of the asphalt.
    line_width : float, m
        Width of the painted lines.
    edge_inset : float, m
        Distance from the edge of the asphalt to the outer rim of the edge lines.
    dash : float, m
        Length of the dashes of the centre line. German guidelines for road markings outside built-up areas
        have 4 m to 6 m.
    gap : float, m
        Length of the gaps between the dashes.
    surface : Asphalt
        The asphalt.
    line_colour : (r, g, b)
        Reflectance of the paint.
    """

    centre: Coordinate = 0.0
    width: Length = 7.5
    line_width: Length = 0.15
    edge_inset: Annotated[float, Field(ge=0, json_schema_extra={"unit": "m"})] = 0.25
    dash: Length = 6.0
    gap: Length = 9.0
    surface: Asphalt = Asphalt()
    line_colour: Reflectance = (0.65, 0.65, 0.62)


@final
class Ground(Value):
    """The flat ground z = `height`, reaching beyond the horizon on all sides.

    Parameters
    ----------
    height : float, m
        z of the ground.
    material : Material
        What the ground is made of.
    road : Road, optional
        A road on it.
    """

    kind: Literal["ground"] = "ground"
    height: Coordinate = 0.0
    material: Material = Sand()
    road: Road | None = None


@final
class Pyramid(Value):
    """A square pyramid.

    Parameters
    ----------
    position : (x, y, z), m
        Middle of the base.
    base : float, m
        Side of the base.
    height : float, m
        Height of the top above the base.
    rotation : float, degrees
        About the vertical, positive to the left; at 0 one face looks back at the camera.
    material : Material
        What it is built of.
    """

    kind: Literal["pyramid"] = "pyramid"
    position: Position = (700.0, 0.0, 0.0)
    base: Length = 36.0
    height: Length = 23.0
    rotation: Degrees = 0.0
    material: Material = Masonry()


@final
class Box(Value):
    """A rectangular box.

    Parameters
    ----------
    position : (x, y, z), m
        Middle of the base.
    size : (x, y, z), m
        Lengths of the sides, before the rotation.
    rotation : float, degrees
        About the vertical, positive to the left.
    material : Material
        What it is made of.
    """

    kind: Literal["box"] = "box"
    position: Position
    size: Annotated[
        tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]],
        Field(json_schema_extra={"unit": "m"}),
    ] = (1.0, 1.0, 1.0)
    rotation: Degrees = 0.0
    material: Material = Colour()


@final
class Pole(Value):
    """An upright round pole with coloured bands, a scale for the eye.

    Parameters
    ----------
    position : (x, y, z), m
        Its foot.
    height : float, m
        From the foot to the top.
    diameter : float, m
        Its thickness.
    bands : int
        Number of bands of equal height, the lowest in the first colour, the next in the second, ...
    colours : two (r, g, b)
        Reflectance of the bands.
    """

    kind: Literal["pole"] = "pole"
    position: Position
    height: Length = 2.0
    diameter: Length = 0.2
    bands: Annotated[int, Field(ge=1, le=1000)] = 4
    colours: tuple[Reflectance, Reflectance] = ((0.7, 0.7, 0.7), (0.6, 0.05, 0.03))


@final
class Sphere(Value):
    """A sphere.

    Parameters
    ----------
    position : (x, y, z), m
        Its middle.
    radius : float, m
        Half its thickness.
    material : Material
        What it is made of.
    """

    kind: Literal["sphere"] = "sphere"
    position: Position
    radius: Length = 1.0
    material: Material = Colour()


@final
class Mesh(Value):
    """A triangle mesh from a file.

    Parameters
    ----------
    file : path
        Path of a PLY or OBJ file.
    position : (x, y, z), m
        Where the file's origin goes.
    rotation : float, degrees
        About the vertical, positive to the left, after `up`.
    scale : float, m
        Length of one unit of the file.
    up : {"z", "y"}
        Which axis of the file points up.
    material : Material
        What it is made of.
    """

    kind: Literal["mesh"] = "mesh"
    file: Path
    position: Position = (0.0, 0.0, 0.0)
    rotation: Degrees = 0.0
    scale: Length = 1.0
    up: Literal["z", "y"] = "z"
    material: Material = Colour()


@final
class Hills(Value):
    """A far ridge with a natural, seeded outline.

    Parameters
    ----------
    distance : float, m
        Horizontal distance of the ridge from the origin.
    height : float, m
        Height of its highest summit.
    azimuth, spread : float, degrees
        Direction of its middle (positive to the left) and the whole angle that it covers.
    base : float, m
        z of its foot.
    seed : int
        Seed of the outline.
    colour : (r, g, b)
        Reflectance.
    """

    kind: Literal["hills"] = "hills"
    distance: Length = 9000.0
    height: Length = 150.0
    azimuth: Degrees = 0.0
    spread: Annotated[float, Field(gt=0, le=360, json_schema_extra={"unit": "degree"})] = 30.0
    base: Coordinate = 0.0
    seed: Annotated[int, Field(ge=0)] = 0
    colour: Reflectance = (0.22, 0.19, 0.15)


@final
class Vehicle(Value):
    """A passenger car.

    Parameters
    ----------
    position : (x, y, z), m
        The point of the ground under its middle.
    heading : float, degrees
        Where its front points; 180 = towards the camera at the origin.
    colour : (r, g, b)
        Reflectance of the paint.
    length : float, m
        From bumper to bumper; width and height follow.
    headlights : bool
        Whether they are switched on.
    """

    kind: Literal["vehicle"] = "vehicle"
    position: Position
    heading: Degrees = 180.0
    colour: Reflectance = (0.45, 0.03, 0.02)
    length: Annotated[float, Field(ge=2, le=12, json_schema_extra={"unit": "m"})] = 4.4
    headlights: bool = False


@final
class Aircraft(Value):
    """An airliner with two engines under its wings, on its wheels.

    Parameters
    ----------
    position : (x, y, z), m
        The point of the ground under its middle.
    heading : float, degrees
        Where its nose points; 180 = towards the camera at the origin.
    colour, fin_colour : (r, g, b)
        Reflectance of the fuselage, and of fin and engines.
    length : float, m
        From nose to tail; span (0.91 of it) and height (0.31 of it) follow. The jet pipes are 0.008 of it in
        front of the middle, 0.153 beside it and 0.047 above the ground.
    lights : bool
        Whether the landing lights are switched on.
    """

    kind: Literal["aircraft"] = "aircraft"
    position: Position
    heading: Degrees = 180.0
    colour: Reflectance = (0.72, 0.73, 0.74)
    fin_colour: Reflectance = (0.03, 0.10, 0.28)
    length: Annotated[float, Field(ge=5, le=90, json_schema_extra={"unit": "m"})] = 37.6
    lights: bool = False


@final
class MitsubaFile(Value):
    """Shapes from a Mitsuba 3 scene of the user's own, in metres with z up.

    Parameters
    ----------
    file : path, optional
        Path of a Mitsuba XML scene; its shapes (with their materials and area lights) are taken, its
        integrator, sensor and environment are not.
    fragment : dict, optional
        A Mitsuba dictionary of one shape or of named shapes, instead of a file.
    """

    kind: Literal["mitsuba"] = "mitsuba"
    file: Path | None = None
    fragment: dict[str, Any] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> MitsubaFile:
        if (self.file is None) == (self.fragment is None):
            raise ValueError("give either file or fragment")
        return self


Object = Annotated[
    Ground | Pyramid | Box | Pole | Sphere | Mesh | Hills | Vehicle | Aircraft | MitsubaFile,
    Field(discriminator="kind"),
]
"""Any object, told apart by its ``kind``."""
