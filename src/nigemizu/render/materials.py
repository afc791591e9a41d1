"""Surface materials that a scene can name. Colours are linear reflectances (red, green, blue), 0 to 1."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, final

from pydantic import Field

from nigemizu.render.light import Reflectance
from nigemizu.values import Value

__all__ = ["Asphalt", "Checker", "Colour", "Dots", "Masonry", "Material", "Sand", "Texture", "Water"]

Length = Annotated[float, Field(gt=0, json_schema_extra={"unit": "m"})]
Positive = Annotated[float, Field(gt=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]


@final
class Colour(Value):
    """One matt colour.

    Parameters
    ----------
    colour : (r, g, b)
        Reflectance.
    """

    kind: Literal["colour"] = "colour"
    colour: Reflectance = (0.5, 0.5, 0.5)


@final
class Texture(Value):
    """An image, laid over the surface's own (u, v) coordinates.

    Parameters
    ----------
    image : path
        Path of a PNG, JPEG or EXR file.
    repeat : (u, v)
        How often the image is repeated across the surface; on the ground, per metre.
    """

    kind: Literal["texture"] = "texture"
    image: Path
    repeat: tuple[Positive, Positive] = (1.0, 1.0)


@final
class Sand(Value):
    """Matt ground with natural unevenness of brightness at all scales that the picture resolves.

    Parameters
    ----------
    colour : (r, g, b)
        Mean reflectance.
    contrast : float
        Relative strength of the unevenness (0 = even).
    scale : float, m
        Length of the coarsest patches along x; across they are a sixteenth as wide, as drifts are. Finer ones
        follow down to a few centimetres, ever rounder.
    seed : int
        Seed of the pattern.
    """

    kind: Literal["sand"] = "sand"
    colour: Reflectance = (0.52, 0.40, 0.27)
    contrast: Fraction = 0.15
    scale: Length = 120.0
    seed: Annotated[int, Field(ge=0)] = 0


@final
class Asphalt(Value):
    """Dark, finely grained road surface.

    Parameters
    ----------
    colour : (r, g, b)
        Mean reflectance.
    contrast : float
        Relative strength of the unevenness (0 = even).
    seed : int
        Seed of the pattern.
    """

    kind: Literal["asphalt"] = "asphalt"
    colour: Reflectance = (0.085, 0.085, 0.09)
    contrast: Fraction = 0.2
    seed: Annotated[int, Field(ge=0)] = 0


@final
class Checker(Value):
    """A chessboard of two colours in horizontal coordinates, for seeing shapes and distances.

    Parameters
    ----------
    colours : two (r, g, b)
        Reflectance of the two kinds of field.
    size : float, m
        Side of one field.
    """

    kind: Literal["checker"] = "checker"
    colours: tuple[Reflectance, Reflectance] = ((0.15, 0.15, 0.15), (0.7, 0.7, 0.7))
    size: Length = 10.0


@final
class Masonry(Value):
    """Courses of cut stone: each course and each stone a little different, with darker joints.

    Parameters
    ----------
    colour : (r, g, b)
        Mean reflectance of the stone.
    course : float, m
        Height of one course.
    contrast : float
        Relative strength of the differences from stone to stone.
    seed : int
        Seed of the pattern.
    """

    kind: Literal["masonry"] = "masonry"
    colour: Reflectance = (0.50, 0.38, 0.25)
    course: Length = 0.6
    contrast: Fraction = 0.3
    seed: Annotated[int, Field(ge=0)] = 0


@final
class Dots(Value):
    """Round dots at random places, the background of background-oriented schlieren.

    They lie in the plane that the surface faces, one at random in each square of a grid, over one another
    where they meet.

    Parameters
    ----------
    colours : two (r, g, b)
        Reflectance of the ground and of the dots.
    diameter : float, m
        Of a dot; two to three pixels of the picture are best to measure displacements with.
    density : float
        Share of the surface that dots would cover if none lay over another: at 0.5 they cover 0.45.
    seed : int
        Seed of the pattern.
    """

    kind: Literal["dots"] = "dots"
    colours: tuple[Reflectance, Reflectance] = ((0.8, 0.8, 0.8), (0.03, 0.03, 0.03))
    diameter: Length = 0.002
    density: Annotated[float, Field(gt=0, le=1.5)] = 0.5
    seed: Annotated[int, Field(ge=0)] = 0


@final
class Water(Value):
    """Sea or lake, rough with waves that are smaller than a pixel.

    The slopes of its facets are distributed as Cox and Munk found them on the sea: their mean square is
    0.003 + 0.00512 times the wind.

    Parameters
    ----------
    wind : float, m/s
        12.5 m above the water.
    colour : (r, g, b)
        Reflectance of the water under the surface.

    References
    ----------
    C. Cox, W. Munk (1954), Measurement of the roughness of the sea surface from photographs of the Sun's
    glitter, Journal of the Optical Society of America 44, 838–850, doi:10.1364/JOSA.44.000838.
    """

    kind: Literal["water"] = "water"
    wind: Annotated[float, Field(ge=0, le=30, json_schema_extra={"unit": "m/s"})] = 4.0
    colour: Reflectance = (0.006, 0.016, 0.022)


Material = Annotated[
    Colour | Texture | Sand | Asphalt | Checker | Masonry | Dots | Water, Field(discriminator="kind")
]
"""Any material, told apart by its ``kind``."""
