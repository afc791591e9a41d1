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

__all__ = ["RenderedPicture"]


@final
@dataclass(frozen=True)
class RenderedPicture:
    """A rendered picture.

    Attributes
    ----------
    pixels : (height, width, 3) float32
        Linear red, green, blue, the camera's exposure included; row 0 is the top.
    statuses : dict of str to int
        Number of camera rays that ended as ``hit``, ``escaped`` and ``out-of-steps``.
    scene : Scene
        What was rendered.
    report : ErrorReport or None
        Estimated errors of the bent rays; None where none are bent.
    """

    pixels: NDArray[np.float32]
    statuses: dict[str, int]
    scene: Scene
    report: ErrorReport | None = None

    def save(self, path: str | os.PathLike[str], *, command: str = "") -> Path:
        """Write ``.png`` (8 bits, sRGB) or ``.exr`` (linear), whole or not at all, and return where it is.

        The scene and the `command` are embedded, so that the picture can be made again.
        """
        from nigemizu.output import Provenance, write_picture

        provenance = Provenance(scene=self.scene.to_toml(), command=command)
        return write_picture(Path(path), self.pixels, provenance=provenance)
