"""The figure of every mirage paper: rays in height against distance, with the profile that bends them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError
from nigemizu.output.figures import figure_file, write_figure
from nigemizu.output.provenance import Provenance
from nigemizu.output.side_view import DiagramRay, Outline, Profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["ray_diagram"]

FloatArray: TypeAlias = NDArray[np.float64]
Surface: TypeAlias = Literal["ground", "sea"]

_COLOURS: Final = {"turned": "#c8442b", "direct": "#2a6f97", "sky": "#8fb3c9", "lost": "#b0b0b0"}
_NAMES: Final = {
    "ground": {
        "turned": "turned back up by the hot air",
        "direct": "to the ground or an object",
        "sky": "to the sky",
        "lost": "out of steps",
    },
    # Heights above a round sea: it falls away under each ray, and a straight one comes up again, too.
    "sea": {
        "turned": "lowest over the sea, then up again",
        "direct": "to the sea or an object",
        "sky": "to the sky",
        "lost": "out of steps",
    },
}
_INK: Final = "#22303a"
_GROUND: Final = {"ground": "#d9c7a3", "sea": "#a9c3cf"}
_OBJECT: Final = "#b08d57"
_POINTS: Final = 600  # per ray; more cannot be seen

_STRIP: Final = 0.065  # depth of the ground that is drawn, in heights of the figure
_LETTER: Final = 0.0085  # width of a letter there, in widths of the figure
_WORTH_A_NAME: Final = 0.05  # length of a vanishing line, in widths of the figure
_ROUND: Final = tuple(digit * 10.0**power for power in range(3, 9) for digit in (1, 2, 5))  # m
_KILOMETRES: Final = 10e3  # m, from which distances are written in kilometres


def ray_diagram(
    path: str | Path,
    *,
    rays: Sequence[DiagramRay],
    profile: Profile | None = None,
    objects: Sequence[Outline] = (),
    vanishing: tuple[ArrayLike, ArrayLike] | None = None,
    eye: tuple[float, float] | None = None,
    title: str = "",
    top: float | None = None,
    surface: Surface = "ground",
    provenance: Provenance | None = None,
) -> Path:
    """Draw height against distance for many rays, with objects, profile and vanishing line.

    Parameters
    ----------
    path : path
        ``.svg``, ``.png`` or ``.pdf``.
    rays : sequence of DiagramRay
    profile : Profile, optional
        Drawn in a narrow panel that shares the axis of the heights.
    objects : sequence of Outline
    vanishing : pair of (m,) array_like, m, optional
        Distances and lowest visible heights, as `vanishing_line` returns them.
    eye : (float, float), m, optional
        Distance and height; the beginning of the first ray unless given.
    title : str
    top : float, m, optional
        Upper end of the axis; found from the rays that turned and from the objects unless given.
    surface : {"ground", "sea"}
        What the heights are above: level ground, or the sea of a round Earth, over which rays turn of
        themselves.
    provenance : Provenance, optional
        Kept in the file's metadata.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Unknown extension, no rays, or a file that cannot be written.
    MachineError
        The disk is full.
    """
    target, kind = figure_file(path)
    if not rays:
        raise InputError("there are no rays to draw", key="rays")
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    place = eye or (float(rays[0].x[0]), float(rays[0].z[0]))
    upper = top or _top(rays, objects, place[1])
    style: Any = {"font.size": 9.5, "axes.edgecolor": _INK, "axes.linewidth": 0.8, "text.color": _INK}
    # A fixed salt and no dates: equal rays give equal files.
    with rc_context({**style, "svg.hashsalt": "nigemizu", "axes.labelcolor": _INK}):
        figure = Figure(figsize=(10.5, 5.0), layout="constrained")
        if profile is None:
            main = figure.add_subplot()
        else:
            side, main = figure.subplots(1, 2, sharey=True, width_ratios=[1, 4.6])
            _draw_profile(side, profile, upper, surface)
        _draw_rays(main, rays)
        _draw_objects(main, objects, upper)
        if vanishing is not None:
            _draw_vanishing(main, np.asarray(vanishing[0]), np.asarray(vanishing[1]), upper)
        _finish(figure, main, rays, objects, place, upper, title, surface, with_label=profile is None)
        if vanishing is not None:
            _name_ground(main, np.asarray(vanishing[0]), place[0], upper, surface)
        return write_figure(figure, target, kind, provenance)


def _top(rays: Sequence[DiagramRay], objects: Sequence[Outline], eye: float) -> float:
    """Height that shows the turned rays, the eye, and as much of the objects as goes with them."""
    turned = [float(ray.z.max()) for ray in rays if ray.kind() == "turned"]
    tallest = max((float(np.max(outline.z)) for outline in objects), default=eye)
    if not turned:
        return 1.15 * max(eye, tallest)
    return 1.15 * max(1.35 * eye, min(tallest, float(np.quantile(turned, 0.9))))


def _draw_profile(axes: Axes, profile: Profile, upper: float, surface: Surface) -> None:
    shown = profile.height <= 1.02 * upper
    axes.plot(1e6 * profile.refractivity[shown], profile.height[shown], color=_INK, lw=1.6)
    axes.set_xlabel("$(n-1)\\times 10^6$")
    axes.set_ylabel(f"height above the {surface} (m)")
    axes.locator_params(axis="x", nbins=4)
    axes.margins(x=0.12)
    axes.spines[["top", "right"]].set_visible(False)
    if profile.temperature is not None:
        twin = axes.twiny()
        warm = "#c8442b"
        twin.plot(
            profile.temperature[shown] - 273.15, profile.height[shown], color=warm, lw=1.4, ls=(0, (5, 2))
        )
        twin.set_xlabel("temperature (°C)", color=warm)
        twin.tick_params(axis="x", colors=warm)
        twin.locator_params(axis="x", nbins=4)
        twin.margins(x=0.12)
        twin.spines[["right"]].set_visible(False)
        twin.spines["top"].set_color(warm)


def _draw_rays(axes: Axes, rays: Sequence[DiagramRay]) -> None:
    from matplotlib.collections import LineCollection

    groups: dict[str, list[FloatArray]] = {}
    for ray in rays:
        chosen = np.unique(np.linspace(0, ray.x.size - 1, min(ray.x.size, _POINTS)).astype(int))
        groups.setdefault(ray.kind(), []).append(np.column_stack([ray.x[chosen], ray.z[chosen]]))
    width = float(np.clip(16.0 / len(rays) ** 0.75, 0.45, 1.1))
    for order, kind in enumerate(("lost", "sky", "direct", "turned")):
        if kind in groups:
            axes.add_collection(
                LineCollection(
                    groups[kind],
                    colors=_COLOURS[kind],
                    linewidths=width,
                    alpha=0.85,
                    zorder=3 + 0.1 * order,
                    capstyle="round",
                )
            )


def _draw_objects(axes: Axes, objects: Sequence[Outline], upper: float) -> None:
    named: list[Outline] = []
    for outline in sorted(objects, key=lambda one: -float(np.max(one.z))):
        axes.fill(outline.x, outline.z, facecolor=_OBJECT, edgecolor="#6d5430", lw=1.0, alpha=0.55, zorder=2)
        # The parts of a ship stand at one place, where one name has room.
        if any(one.x.max() >= outline.x.min() and outline.x.max() >= one.x.min() for one in named):
            continue
        named.append(outline)
        highest = float(np.max(outline.z))
        clipped = highest > 0.93 * upper
        middle = float(0.5 * (np.min(outline.x) + np.max(outline.x)))
        axes.annotate(
            outline.name,
            gid=f"object {outline.name}",
            xy=(middle, upper if clipped else highest),
            xytext=(0, -6 if clipped else 4),
            textcoords="offset points",
            ha="center",
            va="top" if clipped else "bottom",
            color="#4d3a1e",
            weight="bold",
            zorder=6,
            path_effects=_halo(),
        )


def _draw_vanishing(axes: Axes, x: FloatArray, z: FloatArray, upper: float) -> None:
    inside = np.flatnonzero(z <= upper)
    if not inside.size:
        return
    axes.fill_between(x, 0.0, z, color=_INK, alpha=0.10, lw=0, zorder=1.5)
    axes.plot(x, z, color=_INK, lw=2.0, zorder=4)
    axes.plot(x[0], z[0], "o", color=_INK, ms=4, zorder=5)
    if x[-1] - x[0] < _WORTH_A_NAME * x[-1]:
        return
    label = int(inside[int(0.8 * (inside.size - 1))])
    axes.annotate(
        "vanishing line: below it nothing is seen",
        (float(x[label]), float(z[label])),
        xytext=(float(x[int(inside[-1])]) * 0.985, float(z[label]) + 0.13 * upper),
        ha="right",
        va="bottom",
        fontsize=9,
        zorder=6,
        bbox={"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": "none", "alpha": 0.88},
        arrowprops={"arrowstyle": "-", "color": _INK, "lw": 0.9, "shrinkA": 0.0, "shrinkB": 1.0},
    )


def _name_ground(axes: Axes, x: FloatArray, eye: float, upper: float, surface: Surface) -> None:
    """Say within the ground which part of it is seen, where the words have room."""
    if not x.size:
        return
    letter = _LETTER * float(np.ptp(axes.get_xlim()))
    unseen = "“water”: no ground is seen" if surface == "ground" else "no sea is seen"
    for begin, end, words in ((eye, x[0], f"the {surface} is seen"), (x[0], x[-1], unseen)):
        if end - begin > len(words) * letter:
            axes.annotate(
                words,
                (0.5 * (begin + end), -0.5 * _STRIP * upper),
                ha="center",
                va="center",
                fontsize=8.5,
                color="#4d3a1e",
                zorder=6,
            )


def _finish(
    figure: Figure,
    axes: Axes,
    rays: Sequence[DiagramRay],
    objects: Sequence[Outline],
    eye: tuple[float, float],
    upper: float,
    title: str,
    surface: Surface,
    *,
    with_label: bool,
) -> None:
    ends = [float(np.max(ray.x)) for ray in rays if ray.kind() != "sky"] or [float(rays[0].x[-1])]
    far = max([*ends, *(float(np.max(outline.x)) for outline in objects)])
    left = eye[0] - 0.03 * (far - eye[0])
    axes.set_xlim(left, far + 0.03 * (far - eye[0]))
    axes.set_ylim(-_STRIP * upper, upper)
    axes.axhspan(-upper, 0.0, color=_GROUND[surface], zorder=2.5, lw=0)
    axes.axhline(0.0, color="#8a744a", lw=1.0, zorder=4)
    axes.plot(*eye, marker="o", ms=7, mfc="white", mec=_INK, mew=1.5, zorder=7)
    axes.annotate(
        "eye",
        gid="eye",
        xy=eye,
        xytext=(4, 8),
        textcoords="offset points",
        weight="bold",
        zorder=7,
        path_effects=_halo(),
    )
    _label_distances(axes, far)
    if with_label:
        axes.set_ylabel(f"height above the {surface} (m)")
    else:
        axes.tick_params(labelleft=False)
    axes.spines[["top", "right"]].set_visible(False)
    from matplotlib.lines import Line2D

    shown = {ray.kind() for ray in rays}
    axes.legend(
        handles=[
            Line2D([], [], color=_COLOURS[kind], lw=2.0, label=name)
            for kind, name in _NAMES[surface].items()
            if kind in shown
        ],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=4,
        frameon=False,
        handlelength=1.6,
        columnspacing=1.4,
        borderaxespad=0.2,
    )
    if title:
        figure.suptitle(title, fontsize=12.5, weight="bold", x=0.012, ha="left")
    figure.draw_without_rendering()
    box = axes.get_window_extent()
    width, height = np.ptp(axes.get_xlim()) / box.width, np.ptp(axes.get_ylim()) / box.height
    axes.annotate(
        f"heights exaggerated × {_two_digits(width / height)}",
        (1.0, 1.0),
        xycoords="axes fraction",
        xytext=(0, 4),
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize=8.5,
        color="#66727a",
    )


def _label_distances(axes: Axes, far: float) -> None:
    from matplotlib.ticker import FuncFormatter, MultipleLocator

    if far < _KILOMETRES:
        axes.set_xlabel("distance (m)")
        return
    axes.set_xlabel("distance (km)")
    step = next(step for step in _ROUND if far < 10.0 * step)
    axes.xaxis.set_major_locator(MultipleLocator(step))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda metres, _: f"{1e-3 * metres:g}"))


def _halo() -> list[Any]:
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.5, foreground="white")]


def _two_digits(number: float) -> str:
    return f"{float(f'{number:.2g}'):g}"
