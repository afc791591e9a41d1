"""The figure of ground truth: a picture, and by how much what it shows is displaced, in false colours."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.output.figures import figure_file, write_figure
from nigemizu.output.pictures import encoded
from nigemizu.output.provenance import Provenance

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["displacement_figure"]

_SHOWN: Final = 99.5  # per cent of the pixels that the colours tell apart; edges of mirages go far beyond
_LEAST: Final = 0.01  # pixels that the colours span at least
_SIDE: Final = 4.4  # inches, the longer side of a panel
_LOST: Final = "#808080"
_SCALE: Final[dict[str, Any]] = {
    "location": "bottom", "shrink": 0.9, "aspect": 30, "pad": 0.02, "label": "pixels",
}  # fmt: skip


def displacement_figure(
    path: str | Path,
    radiance: ArrayLike,
    displacement_x: ArrayLike,
    displacement_y: ArrayLike,
    *,
    title: str = "",
    provenance: Provenance | None = None,
) -> Path:
    """Draw the picture, the length of the displacement, and its two components.

    Parameters
    ----------
    path : path
        ``.png``, ``.svg`` or ``.pdf``.
    radiance : (height, width, 3) array_like
        Linear light.
    displacement_x, displacement_y : (height, width) array_like, pixels
        To the right, and down; NaN is drawn grey.
    title : str
    provenance : Provenance, optional
        Kept in the file's metadata.

    Returns
    -------
    Path

    Notes
    -----
    Wide pictures stand in two rows, tall ones side by side. The colours span 99.5 % of the pixels.
    """
    target, kind = figure_file(path)
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    x, y = (np.asarray(part, dtype=np.float64) for part in (displacement_x, displacement_y))
    height, width = x.shape
    rows = 1 if height > width else 2
    scale = _SIDE / max(height, width)
    size = (width * scale * 4 / rows + 0.6, (height * scale + 1.1) * rows + 0.3)
    # A fixed salt and no dates: equal figures are equal files.
    with rc_context({"font.size": 9.0, "svg.hashsalt": "nigemizu"}):
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(rows, 4 // rows).ravel()
        picture = panels[0].imshow(encoded(radiance), interpolation="none")
        panels[0].set_title("the picture")
        # room for a scale that is not there: all panels become equally large
        unused = figure.colorbar(picture, ax=panels[0], **_SCALE)
        unused.ax.axis("off")
        for artist in unused.ax.get_children():
            artist.set_alpha(0.0)
        length = np.hypot(x, y)
        spread = _span(length)
        for axes, values, name, colours, lowest in (
            (panels[1], length, "displacement", "inferno", 0.0),
            (panels[2], x, "to the right", "RdBu_r", -spread),
            (panels[3], y, "down", "RdBu_r", -spread),
        ):
            _draw(figure, axes, values, name, colours, (lowest, spread))
        for axes in panels:
            axes.set_xticks([])
            axes.set_yticks([])
        if title:
            figure.suptitle(title, fontsize=11, weight="bold", x=0.012, ha="left")
        return write_figure(figure, target, kind, provenance)


def _span(lengths: NDArray[np.float64]) -> float:
    known = lengths[np.isfinite(lengths)]
    return max(float(np.percentile(known, _SHOWN)) if known.size else 0.0, _LEAST)


def _draw(
    figure: Figure,
    axes: Axes,
    values: NDArray[np.float64],
    name: str,
    colours: str,
    limits: tuple[float, float],
) -> None:
    import matplotlib

    shades: Any = matplotlib.colormaps[colours].with_extremes(bad=_LOST)
    shown = np.ma.masked_invalid(values)
    image = axes.imshow(shown, cmap=shades, vmin=limits[0], vmax=limits[1], interpolation="none")
    axes.set_title(name)
    figure.colorbar(image, ax=axes, **_SCALE)
