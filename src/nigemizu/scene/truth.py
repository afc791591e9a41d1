"""Ground truth beside a picture: as layers of an OpenEXR file, and as a labelled dataset."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

    from nigemizu.render.truth import GroundTruth
    from nigemizu.scene.model import Scene

__all__ = ["PictureTruth"]

# our name → channel, unit, meaning
_LAYERS: Final = {
    "displacement_x": ("displacement.x", "pixel", "to the right, from where it would be without air"),
    "displacement_y": ("displacement.y", "pixel", "down, from where it would be without air"),
    "path_length": ("path_length.m", "m", "along the bent ray to what it meets; infinite where nothing"),
    "straight_distance": ("straight_distance.m", "m", "to what would be seen without air"),
    "turning_height": ("turning_height.m", "m", "least height at which the ray turns upwards"),
    "optical_path_excess": ("optical_path_excess.m", "m", "optical path less the length of the path"),
    "status": ("status", "1", "how the ray ended"),
}


@final
@dataclass(frozen=True)
class PictureTruth:
    """What each pixel of a picture sees, and the picture without air.

    Attributes
    ----------
    layers : GroundTruth
        Of the rays through the middles of the pixels.
    seen : (height, width, 3) float32
        The picture, linear, without noise.
    straight : (height, width, 3) float32
        The same without air.
    time : float, s
    scene : Scene
    """

    layers: GroundTruth
    seen: NDArray[np.float32]
    straight: NDArray[np.float32]
    time: float
    scene: Scene

    def dataset(self) -> xr.Dataset:
        """All of it on (row, column), with units."""
        import xarray as xr

        from nigemizu.trace import RayStatus

        variables: dict[str, Any] = {
            name: (("row", "column"), getattr(self.layers, name), {"units": unit, "long_name": meaning})
            for name, (_, unit, meaning) in _LAYERS.items()
        }
        endings = [status for status in RayStatus if status.label != "not-traced"]
        variables["status"][2].update(
            flag_values=np.array([int(status) for status in endings]),
            flag_meanings=" ".join(status.label for status in endings),
        )
        for name, pixels, meaning in (
            ("radiance", self.seen, "linear light through air"),
            ("straight_radiance", self.straight, "linear light without air"),
        ):
            variables[name] = (("row", "column", "colour"), pixels, {"units": "1", "long_name": meaning})
        height, width = self.layers.status.shape
        coordinates = {
            "row": ("row", np.arange(height), {"long_name": "row of pixels, from the top"}),
            "column": ("column", np.arange(width), {"long_name": "column of pixels, from the left"}),
            "colour": ("colour", ["red", "green", "blue"]),
            "time": ((), self.time, {"units": "s", "long_name": "time since the start"}),
        }
        attributes = {
            "title": f"Ground truth: {self.scene.title}",
            "pixel_angle_rad": self.scene.camera.pixel_angle,
            "nigemizu_scene": self.scene.to_toml(),
        }
        return xr.Dataset(variables, coordinates, attributes)

    def save(self, stem: Path, *, command: str = "", figure: bool = False) -> list[Path]:
        """Write ``STEM.exr`` and ``STEM.nc``, with `figure` ``STEM.png`` too, and return where they are."""
        from nigemizu.output import Provenance, displacement_figure, write_layers, write_pixels

        channels = {channel: getattr(self.layers, name) for name, (channel, _, _) in _LAYERS.items()}
        for prefix, pixels in (("", self.seen), ("straight.", self.straight)):
            channels |= {f"{prefix}{colour}": pixels[..., number] for number, colour in enumerate("RGB")}
        provenance = Provenance(scene=self.scene.to_toml(), command=command)
        written = [
            write_layers(stem.with_name(f"{stem.name}.exr"), channels, provenance=provenance),
            write_pixels(stem.with_name(f"{stem.name}.nc"), self.dataset()),
        ]
        if figure:
            place, title = stem.with_name(f"{stem.name}.png"), self.scene.title
            x, y = self.layers.displacement_x, self.layers.displacement_y
            written.append(displacement_figure(place, self.seen, x, y, title=title, provenance=provenance))
        return written
