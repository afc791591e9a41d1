"""The figures of those who measure: transfer curves of far objects, and refraction against elevation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.output.figures import figure_file, write_figure
from nigemizu.output.provenance import Provenance
from nigemizu.output.side_view import Profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["RefractionFigure", "TransferFigure", "refraction_figure", "transfer_figure"]

FloatArray: TypeAlias = NDArray[np.float64]

_INK: Final = "#22303a"
_FAINT: Final = "#66727a"
_ERECT: Final = "#2a6f97"
_INVERTED: Final = "#c8442b"
_GROUND: Final = "#d9c7a3"
_WARM: Final = "#c8442b"
_STYLE: Final[Any] = {
    "font.size": 9.5, "axes.edgecolor": _INK, "axes.linewidth": 0.8, "text.color": _INK,
    "axes.labelcolor": _INK, "svg.hashsalt": "nigemizu",
}  # fmt: skip
_MINUTES: Final = 60 * 180 / np.pi
_SECONDS: Final = 60 * _MINUTES
_BEYOND: Final = 1.8  # greatest height that is drawn, in heights of all images but the uppermost
_ROOM: Final = 0.25  # of the width, that the words at a fold take up
_LEVELS: Final = (0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 45.0, 90.0)  # degrees that are named
_SPAN: Final = 1.0 / 500.0  # of the greatest refraction, down to which it is drawn
_NARROW: Final = 2.0  # degrees: elevations that reach no higher are drawn evenly, in minutes
_INSET: Final = 10.0  # degrees, to which the inset reaches


@final
@dataclass(frozen=True, eq=False)
class TransferFigure:
    """What the figure of a transfer curve shows.

    Parameters
    ----------
    distance : float, m
    elevation : (n,) float64, rad
        Increasing.
    height : (n,) float64, m
        NaN where the ray does not come to the object.
    straight : (n,) float64, m
        The same without air.
    folds : sequence of (float, float, bool), rad and m
        Elevation, height, and whether it is the lowest near there.
    bands : sequence of (float, float, bool), rad
        Edges of each image, and whether it is erect.
    profile : Profile, optional
        The air, in a panel of its own.
    eye : float, m, optional
        Height of the eye.
    title : str
    """

    distance: float
    elevation: FloatArray
    height: FloatArray
    straight: FloatArray
    folds: Sequence[tuple[float, float, bool]]
    bands: Sequence[tuple[float, float, bool]]
    profile: Profile | None = None
    eye: float | None = None
    title: str = ""


@final
@dataclass(frozen=True, eq=False)
class RefractionFigure:
    """What the figure of astronomical refraction shows.

    Parameters
    ----------
    elevation : (n,) float64, rad
        Apparent, increasing.
    wavelength : (k,) float64, m
    refraction : (n, k) float64, rad
        NaN where the ray meets the ground.
    title : str
    """

    elevation: FloatArray
    wavelength: FloatArray
    refraction: FloatArray
    title: str = ""


def transfer_figure(path: str | Path, shown: TransferFigure, *, provenance: Provenance | None = None) -> Path:
    """Draw apparent elevation against height of the object, erect and inverted images apart.

    Parameters
    ----------
    path : path
        ``.svg``, ``.png`` or ``.pdf``.
    shown : TransferFigure
    provenance : Provenance, optional
        Kept in the file's metadata.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Unknown extension, nothing to draw, or a file that cannot be written.
    MachineError
        The disk is full.

    Notes
    -----
    As the field draws it: the apparent elevation upwards, in minutes of arc, as the picture has it; the
    height of the object to the right. A vertical line meets the curve once for each image of a height.
    """
    target, kind = figure_file(path)
    if not np.any(np.isfinite(shown.height)):
        raise InputError("no ray comes to the object: there is nothing to draw", file=str(target))
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(figsize=(9.0, 5.2), layout="constrained")
        window = _window(shown)
        if shown.profile is None:
            main = figure.add_subplot()
        else:
            side, main = figure.subplots(1, 2, width_ratios=[1, 3.2])
            _draw_profile(side, shown.profile, shown.eye, window[1])
        _draw_transfer(main, shown, window)
        if shown.title:
            figure.suptitle(shown.title, fontsize=12.5, weight="bold", x=0.012, ha="left")
        return write_figure(figure, target, kind, provenance)


def refraction_figure(
    path: str | Path, shown: RefractionFigure, *, provenance: Provenance | None = None
) -> Path:
    """Draw refraction against apparent elevation, and in an inset by how much colours are apart.

    Parameters
    ----------
    path : path
        ``.svg``, ``.png`` or ``.pdf``.
    shown : RefractionFigure
    provenance : Provenance, optional
        Kept in the file's metadata.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Unknown extension, nothing to draw, or a file that cannot be written.
    MachineError
        The disk is full.

    Notes
    -----
    Elevations are drawn evenly up to 1° and by their logarithm above, where refraction is all but a power;
    those of a fan that ends below 2° evenly throughout, with all colours and without an inset.
    """
    target, kind = figure_file(path)
    if not np.any(np.isfinite(shown.refraction)):
        raise InputError("no ray leaves the air: there is nothing to draw", file=str(target))
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(figsize=(8.4, 5.0), layout="constrained")
        _draw_refraction(figure.add_subplot(), shown)
        if shown.title:
            figure.suptitle(shown.title, fontsize=12.5, weight="bold", x=0.012, ha="left")
        return write_figure(figure, target, kind, provenance)


def _window(shown: TransferFigure) -> tuple[float, float, float, float]:
    """Heights [m] and elevations [rad] between which the curve is drawn: what is around the folds."""
    low, high = float(np.nanmin(shown.height)), float(np.nanmax(shown.height))
    if len(shown.bands) > 1:
        # All but the uppermost image, which goes on into the sky.
        folded = np.isfinite(shown.height) & (shown.elevation <= shown.bands[-1][0])
        ends = [height for _, height, _ in shown.folds] + shown.height[folded].tolist()
        high = min(high, low + _BEYOND * max(max([*ends, shown.eye or low]) - low, 1e-3 * (high - low)))
    inside = np.isfinite(shown.height) & (shown.height <= high)
    seen = shown.elevation[inside]
    margin = 0.06 * max(float(np.ptp(seen)), 1e-6)
    left = 0.0 if 0.0 <= low < 0.5 * high else low
    return left - 0.03 * (high - left), high, float(seen.min()) - margin, float(seen.max()) + 0.5 * margin


def _draw_profile(axes: Axes, profile: Profile, eye: float | None, upper: float) -> None:
    upper = max(upper, 1.15 * (eye or 0.0))
    shown = profile.height <= 1.3 * upper
    if np.count_nonzero(shown) < 2:
        shown = profile.height <= profile.height[1]
    axes.plot(1e6 * profile.refractivity[shown], profile.height[shown], color=_INK, lw=1.6)
    axes.set_xlabel("$(n-1)\\times 10^6$")
    axes.set_ylabel("height (m)")
    axes.locator_params(axis="x", nbins=3)
    axes.margins(x=0.12)
    axes.set_ylim(min(float(profile.height[0]), 0.0), upper)
    axes.spines[["top", "right"]].set_visible(False)
    if eye is not None:
        axes.axhline(eye, color=_FAINT, lw=0.8, ls=":")
        axes.annotate(
            "eye", (1.0, eye), xycoords=("axes fraction", "data"), xytext=(-2, 2),
            textcoords="offset points", ha="right", fontsize=8.5, color=_FAINT,
        )  # fmt: skip
    if profile.temperature is not None:
        twin = axes.twiny()
        warmth = profile.temperature[shown] - 273.15
        twin.plot(warmth, profile.height[shown], color=_WARM, lw=1.4, ls=(0, (5, 2)))
        twin.set_xlabel("temperature (°C)", color=_WARM)
        twin.tick_params(axis="x", colors=_WARM)
        twin.locator_params(axis="x", nbins=3)
        twin.margins(x=0.12)
        twin.spines[["right"]].set_visible(False)
        twin.spines["top"].set_color(_WARM)


def _draw_transfer(axes: Axes, shown: TransferFigure, window: tuple[float, float, float, float]) -> None:
    left, right, bottom, top = window
    axes.plot(shown.straight, _MINUTES * shown.elevation, color=_FAINT, lw=1.0, ls=(0, (4, 3)), zorder=2)
    for low, high, erect in shown.bands:
        inside = (shown.elevation >= low) & (shown.elevation <= high)
        axes.plot(
            shown.height[inside],
            _MINUTES * shown.elevation[inside],
            color=_ERECT if erect else _INVERTED,
            lw=2.0,
            zorder=4,
            solid_capstyle="butt",
        )
    for elevation, height, lowest in shown.folds:
        if not (bottom <= elevation <= top and left <= height <= right):
            continue
        axes.plot(height, _MINUTES * elevation, "o", ms=5, mfc="white", mec=_INK, mew=1.4, zorder=6)
        # The curve goes on to the right of its lowest.
        aside = lowest and height - left > _ROOM * (right - left)
        words = f"fold {_MINUTES * elevation:.2f}′, {_metres(height)}".replace("-", "−")
        axes.annotate(
            words,
            (height, _MINUTES * elevation),
            gid=words,
            xytext=(-8, 0) if aside else (8, 0),
            ha="right" if aside else "left",
            textcoords="offset points",
            va="center",
            fontsize=8.5,
            zorder=7,
            path_effects=_halo(),
        )
    axes.set_xlim(left, right)
    axes.set_ylim(_MINUTES * bottom, _MINUTES * top)
    foot = min((low for low, _, _ in shown.bands), default=bottom)
    if foot > bottom:
        axes.axhspan(_MINUTES * bottom, _MINUTES * foot, color=_GROUND, lw=0, alpha=0.7, zorder=1)
        axes.annotate(
            "the surface hides the object", (0.99, _MINUTES * foot), xycoords=("axes fraction", "data"),
            xytext=(0, -3), textcoords="offset points", ha="right", va="top", fontsize=8.5, color="#4d3a1e",
        )  # fmt: skip
    axes.axhline(0.0, color=_FAINT, lw=0.8, ls=":", zorder=1.5)
    axes.set_xlabel(f"height at {_kilometres(shown.distance)} (m)")
    axes.set_ylabel("apparent elevation (′)")
    axes.spines[["top", "right"]].set_visible(False)
    _name_branches(axes, {erect for _, _, erect in shown.bands})


def _name_branches(axes: Axes, kinds: set[bool]) -> None:
    from matplotlib.lines import Line2D

    entries = [Line2D([], [], color=_ERECT, lw=2.0, label="erect")] if True in kinds else []
    if False in kinds:
        entries.append(Line2D([], [], color=_INVERTED, lw=2.0, label="inverted"))
    entries.append(Line2D([], [], color=_FAINT, lw=1.0, ls=(0, (4, 3)), label="without air"))
    axes.legend(
        handles=entries,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=3,
        frameon=False,
        handlelength=1.8,
        columnspacing=1.4,
        borderaxespad=0.2,
    )


def _draw_refraction(axes: Axes, shown: RefractionFigure) -> None:
    degrees = np.degrees(shown.elevation)
    middle = shown.refraction.shape[1] // 2
    chosen = np.isfinite(shown.refraction[:, middle]) & (shown.refraction[:, middle] > 0.0)
    low, high = float(degrees[chosen].min()), float(degrees[chosen].max())
    axes.grid(color="#e4e7e9", lw=0.7)
    axes.set_axisbelow(True)
    axes.set_ylabel("refraction (′)")
    axes.spines[["top", "right"]].set_visible(False)
    if high <= _NARROW:
        _draw_near_horizon(axes, shown)
        return
    axes.plot(degrees[chosen], _MINUTES * shown.refraction[chosen, middle], color=_ERECT, lw=2.0)
    axes.set_xscale("symlog", linthresh=1.0, linscale=0.7)
    axes.set_yscale("log")
    highest = _MINUTES * float(shown.refraction[chosen, middle].max())
    axes.set_ylim(_SPAN * highest, 1.6 * highest)
    named = [level for level in _LEVELS if low <= level <= high]
    axes.set_xticks(named, [f"{level:g}" for level in named])
    axes.set_xticks([], minor=True)
    axes.set_xlim(low - 0.03 * (1.0 + abs(low)), high)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel("apparent elevation (°)")
    words = f"{1e9 * shown.wavelength[middle]:.0f} nm"
    axes.annotate(words, (0.98, 0.95), xycoords="axes fraction", ha="right", va="top", color=_FAINT)
    if len(shown.wavelength) > 1:
        _draw_dispersion(axes, shown, _spectrum(shown.wavelength), middle)


def _draw_near_horizon(axes: Axes, shown: RefractionFigure) -> None:
    """All colours, evenly: where the air lifts the horizon, curves do what they will."""
    several = len(shown.wavelength) > 1
    colours = _spectrum(shown.wavelength) if several else [_ERECT]
    for length, curve, colour in zip(shown.wavelength, shown.refraction.T, colours, strict=True):
        axes.plot(
            _MINUTES * shown.elevation, _MINUTES * curve, color=colour, lw=1.6, label=f"{1e9 * length:.0f} nm"
        )
    axes.set_xlabel("apparent elevation (′)")
    axes.legend(frameon=False)


def _draw_dispersion(axes: Axes, shown: RefractionFigure, colours: list[Any], middle: int) -> None:
    """By how many seconds each colour is lifted more than the middle one, near the horizon."""
    inset = axes.inset_axes((0.075, 0.1, 0.46, 0.47))
    degrees = np.degrees(shown.elevation)
    near = degrees <= _INSET if np.any(degrees <= _INSET) else np.ones(len(degrees), dtype=bool)
    for number, length in enumerate(shown.wavelength):
        apart = _SECONDS * (shown.refraction[near, number] - shown.refraction[near, middle])
        inset.plot(degrees[near], apart, color=colours[number], lw=1.5)
        finite = np.flatnonzero(np.isfinite(apart))
        if finite.size and number in (0, len(shown.wavelength) - 1):
            inset.annotate(
                f"{1e9 * length:.0f} nm", (degrees[near][finite[0]], apart[finite[0]]), xytext=(5, 0),
                textcoords="offset points", va="center", fontsize=8, color=colours[number],
                path_effects=_halo(),
            )  # fmt: skip
    inset.set_title(f"lifted more than {1e9 * shown.wavelength[middle]:.0f} nm (″)", fontsize=8.5, loc="left")
    inset.tick_params(labelsize=8)
    inset.spines[["top", "right"]].set_visible(False)
    inset.patch.set_alpha(0.9)


def _spectrum(wavelength: FloatArray) -> list[Any]:
    """A colour for each wavelength, from violet to red as light has them."""
    import matplotlib

    shades = matplotlib.colormaps["turbo"]
    return [shades(0.05 + 0.9 * float(np.clip((length - 380e-9) / 370e-9, 0, 1))) for length in wavelength]


def _metres(height: float) -> str:
    return f"{height:.2f} m" if abs(height) < 10 else f"{height:.1f} m"


def _kilometres(distance: float) -> str:
    return f"{distance / 1e3:g} km" if distance >= 1e3 else f"{distance:g} m"


def _halo() -> list[Any]:
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.5, foreground="white")]
