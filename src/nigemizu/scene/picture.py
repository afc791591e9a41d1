"""A picture with the scene that it shows."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from nigemizu.render.report import ErrorReport
    from nigemizu.scene.model import Scene
    from nigemizu.scene.truth import PictureTruth

__all__ = ["RenderedPicture"]


@final
@dataclass(frozen=True)
class RenderedPicture:
    """A rendered picture.

    Attributes
    ----------
    pixels : (height, width, 3) float32
        Linear red, green, blue as the camera sees them, its exposure, diffraction and noise included; row 0
        is the top.
    statuses : dict of str to int
        Number of camera rays that ended as ``hit``, ``escaped`` and ``out-of-steps``.
    scene : Scene
        What was rendered.
    report : ErrorReport or None
        Estimated errors of the bent rays; None where none are bent.
    before_noise : (height, width, 3) float32 or None
        What `pixels` were before the camera's noise; None where it has none. See `noiseless`.
    truth : PictureTruth or None
        What each pixel sees; None unless it was asked for.
    """

    pixels: NDArray[np.float32]
    statuses: dict[str, int]
    scene: Scene
    report: ErrorReport | None = None
    before_noise: NDArray[np.float32] | None = None
    truth: PictureTruth | None = None

    @property
    def noiseless(self) -> NDArray[np.float32]:
        """The picture (height, width, 3) without noise and not cut off at saturation: the ground truth."""
        return self.pixels if self.before_noise is None else self.before_noise

    @property
    def shown(self) -> NDArray[np.float32]:
        """The picture with colours that a screen can show: light of single wavelengths lies outside."""
        if self.scene.light.sky != "physical":
            return self.pixels
        from nigemizu.render.spectrum import into_gamut

        return into_gamut(self.pixels).astype(np.float32)

    def save(self, path: str | os.PathLike[str], *, command: str = "") -> Path:
        """Write ``.png`` (8 bits, sRGB) or ``.exr`` (linear), whole or not at all, and return where it is.

        The scene and the `command` are embedded, so that the picture can be made again. Ground truth, if
        there is any, goes beside it, into ``NAME_truth.exr`` and ``NAME_truth.nc``, and as a figure of the
        displacement into ``NAME_truth.png``.
        """
        from nigemizu.output import Provenance, write_picture

        path = Path(path)
        provenance = Provenance(scene=self.scene.to_toml(), command=command)
        shown = self.shown if path.suffix.lower() == ".png" else self.pixels
        written = write_picture(path, shown, highlights=self.scene.camera.highlights, provenance=provenance)
        if self.truth is not None:
            self.truth.save(path.with_name(f"{path.stem}_truth"), command=command, figure=True)
        return written
