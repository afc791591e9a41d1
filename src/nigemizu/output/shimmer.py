"""The figure of a measured film: where it shimmers, how the motion of two points differs, and how fast."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.output.figures import figure_file, write_figure
from nigemizu.output.provenance import Provenance

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["ShimmerFigure", "shimmer_figure"]

FloatArray: TypeAlias = NDArray[np.float64]

_INK: Final = "#22303a"
_ALONG: Final = "#c8442b"
_ACROSS: Final = "#2a6f97"
_WIDE: Final = 2.5  # width over height of a picture beside which a bar would be taller


@final
@dataclass(frozen=True)
class ShimmerFigure:
    """What is drawn.

    Parameters
    ----------
    picture : (height, width) ndarray
        Grey values from 0 to 1.
    places : (M, 2) float64, pixels
        Column and row of the middle of each tile.
    side : int, pixels
        Of the tiles.
    rms : (M,) float64, microradian
        NaN where a tile shows nothing.
    separation : (B,) float64, rad
    along, across : (B,) float64, rad2
        Mean squared differences of the angle, along the line between two tiles and across it.
    along_theory, across_theory : (B,) float64 or None, rad2
    lag, correlation : (K,) float64, `unit` and 1
    frequency, power : (F,) float64, 1/`unit` and rad2 `unit`
    white : float
        Level of the noise in `power`.
    unit : str
        ``"s"`` or ``"frames"``.
    title : str
    """

    picture: NDArray[np.float32]
    places: FloatArray
    side: int
    rms: FloatArray
    separation: FloatArray
    along: FloatArray
    across: FloatArray
    along_theory: FloatArray | None
    across_theory: FloatArray | None
    lag: FloatArray
    correlation: FloatArray
    frequency: FloatArray
    power: FloatArray
    white: float
    unit: str
    title: str = ""


def shimmer_figure(path: str | Path, shown: ShimmerFigure, *, provenance: Provenance | None = None) -> Path:
    """Draw four panels: the picture with its tiles, the structure function, the correlation, the spectrum.

    Parameters
    ----------
    path : path
        ``.svg``, ``.png`` or ``.pdf``.
    shown : ShimmerFigure
    provenance : Provenance, optional
        Kept in the file's metadata.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Unknown extension, or a file that cannot be written.
    MachineError
        The disk is full.
    """
    target, kind = figure_file(path)
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style: Any = {"font.size": 9.5, "axes.edgecolor": _INK, "axes.linewidth": 0.8, "text.color": _INK}
    # A fixed salt and no dates: equal films give equal files.
    with rc_context({**style, "svg.hashsalt": "nigemizu", "axes.labelcolor": _INK}):
        figure = Figure(figsize=(10.5, 7.0), layout="constrained")
        (upper_left, upper_right), (lower_left, lower_right) = figure.subplots(2, 2)
        _draw_tiles(figure, upper_left, shown)
        _draw_differences(upper_right, shown)
        _draw_correlation(lower_left, shown)
        _draw_spectrum(lower_right, shown)
        if shown.title:
            figure.suptitle(shown.title, fontsize=12.5, weight="bold", x=0.012, ha="left")
        return write_figure(figure, target, kind, provenance)


def _draw_tiles(figure: Figure, axes: Axes, shown: ShimmerFigure) -> None:
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    axes.imshow(shown.picture, cmap="gray", vmin=0.0, vmax=max(1.0, float(np.max(shown.picture))))
    seen = np.isfinite(shown.rms)
    corners = shown.places[seen] - (shown.side - 1) / 2 - 0.5
    squares = [Rectangle((float(x), float(y)), shown.side, shown.side) for x, y in corners]
    tiles = PatchCollection(squares, cmap="viridis", alpha=0.45, edgecolor="white", linewidth=0.4)
    tiles.set_array(shown.rms[seen])
    if seen.any() and float(np.ptp(shown.rms[seen])) < 1e-3 * float(np.max(shown.rms[seen])):
        tiles.set_clim(0.0, 1.2 * float(np.max(shown.rms[seen])))
    axes.add_collection(tiles)
    height, width = shown.picture.shape
    below = width > _WIDE * height
    figure.colorbar(
        tiles,
        ax=axes,
        shrink=0.85,
        location="bottom" if below else "right",
        label="angle of arrival, rms (µrad)",
    )
    axes.set_xlabel("column (pixels)")
    axes.set_ylabel("row (pixels)")


def _draw_differences(axes: Axes, shown: ShimmerFigure) -> None:
    angle, square = 1e6 * shown.separation, 1e12
    rows = (
        (shown.along, shown.along_theory, _ALONG, "o", "along the line of two tiles"),
        (shown.across, shown.across_theory, _ACROSS, "s", "across it"),
    )
    for measured, _, colour, marker, words in rows:
        axes.plot(angle, square * measured, marker, color=colour, ms=5, label=words)
    for _, theory, colour, _, _ in rows:
        if theory is not None:
            name = "theory" if colour == _ALONG else None
            axes.plot(angle, square * theory, color=colour, lw=1.3, alpha=0.8, label=name)
    axes.set_xlabel("separation (µrad)")
    axes.set_ylabel("mean squared difference (µrad²)")
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(left=0.0)
    if angle.size:
        axes.legend(
            frameon=False,
            fontsize=8.5,
            ncols=3,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            handlelength=1.4,
            columnspacing=1.2,
        )
    _open_corner(axes)


def _draw_correlation(axes: Axes, shown: ShimmerFigure) -> None:
    axes.axhline(0.0, color=_INK, lw=0.6, alpha=0.5)
    axes.plot(shown.lag, shown.correlation, ".-", color=_INK, lw=1.2, ms=4)
    axes.set_xlabel(f"lag ({shown.unit})")
    axes.set_ylabel("autocorrelation")
    axes.set_ylim(-0.6, 1.1)
    axes.set_yticks((-0.5, 0.0, 0.5, 1.0))
    axes.set_xlim(left=0.0)
    _open_corner(axes)


def _draw_spectrum(axes: Axes, shown: ShimmerFigure) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    positive = shown.power > 0
    if positive.any():
        power = 1e12 * shown.power[positive]
        axes.loglog(shown.frequency[positive], power, color=_INK, lw=1.4)
        # whole decades, so that the axis has numbers
        low, high = math.log10(power.min() / 1.2), math.log10(1.2 * power.max())
        axes.set_ylim(10.0 ** math.floor(low), 10.0 ** math.ceil(high))
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        if 3e12 * shown.white > float(power.min()):
            axes.axhline(1e12 * shown.white, color=_ACROSS, lw=1.0, ls=(0, (5, 2)), label="noise, taken off")
            axes.legend(frameon=False, fontsize=8.5)
    axes.set_xlabel("frequency (Hz)" if shown.unit == "s" else "frequency (cycles per frame)")
    axes.set_ylabel("power (µrad²/Hz)" if shown.unit == "s" else "power (µrad² per cycle per frame)")
    _open_corner(axes)


def _open_corner(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
