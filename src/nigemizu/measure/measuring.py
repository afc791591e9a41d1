"""From a film to displacements: three readings, one frame in memory at a time."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.measure.films import Film, open_film
from nigemizu.measure.moments import Moments
from nigemizu.measure.optics import optics_of
from nigemizu.measure.result import Measurement
from nigemizu.measure.tiles import BORDER, IntArray, Texture, grid_of_tiles, texture_of
from nigemizu.measure.tracking import Displacements, Follower, Searcher, coefficients_of, smoothed, warped
from nigemizu.progress import SILENT, ProgressMeter

__all__ = ["Tracked", "measure_film"]

FloatArray: TypeAlias = NDArray[np.float64]

FEWEST: Final = 16
_REFERENCES: Final = 32  # frames out of which each tile takes its first template
_LOSS: Final = 0.05  # share of the frames in which a tile may be lost


@final
@dataclass(frozen=True)
class Tracked:
    """Everything that the frames gave.

    Attributes
    ----------
    corners : (M, 2) int
        Row and column of all tiles.
    kept : (K,) int
        Which of them were followed.
    texture : Texture
        Of those.
    moments : Moments
    common : (2,) float64, pixels
        Root mean square of the mean motion of all tiles.
    """

    corners: IntArray
    tile: int
    search: int
    kept: IntArray
    texture: Texture
    moments: Moments
    common: FloatArray


def measure_film(
    film: str | Path | Film,
    *,
    tile: int | None = None,
    search: int | None = None,
    remove_shake: bool = False,
    points: bool = False,
    interval: float | None = None,
    progress: ProgressMeter = SILENT,
    **optics: Any,
) -> Measurement:
    """Measure the displacements of the texture in a film, and the turbulence that they stand for.

    Parameters
    ----------
    film : path or Film
        See `open_film`, and `Film.from_frames` for frames in memory.
    tile, search : int, pixels, optional
        Side of the tiles, and how far they may move; found from the size of the picture unless given.
    remove_shake : bool
        Take out the motion that all tiles share, as a camera makes that is not held still. The strength of
        the turbulence then follows from the differences between tiles alone.
    points : bool
        Take tiles for points, as the closed forms of the literature do. By default their motion counts as
        the mean over the directions within them, which is smaller.
    interval : float, s, optional
        Time between frames; that of the film unless given.
    progress : ProgressMeter
        Advances by frames, of which each is read three times.
    **optics
        As for `optics_of`; for one of our own films all of it comes from its scene.

    Returns
    -------
    Measurement

    Raises
    ------
    InputError
        No film, less than 16 frames, frames that are all equal, no texture, or optics that are missing.

    Notes
    -----
    The first reading finds the mean picture, the second a template for each tile, put together from all
    frames where the tile was found; the third follows the templates (`nigemizu.measure.tracking`). The
    memory for it does not depend on the number of frames.

    Limits: tiles move as a whole, without turning or growing. What does not move with the scene (dirt on the
    sensor, a caption) holds a tile back. Noise is taken for white: that of a strongly compressed film is not.

    Examples
    --------
    >>> measured = measure_film("road.mp4", distance=500, aperture=0.05, pixel_angle=1e-5)  # doctest: +SKIP
    >>> print(measured.table())  # doctest: +SKIP
    """
    from nigemizu.measure.evaluation import evaluate

    film = film if isinstance(film, Film) else open_film(film)
    known = optics_of(film, **optics)
    if interval is not None and not interval > 0:
        raise InputError("impossible time between frames", key="--fps", value=interval, expected="above 0")
    grid_of_tiles(film.shape, tile, search)  # refused before any work
    mean, count = _survey(film, progress)
    tracked = _track(film, mean, count, tile, search, remove_shake, progress)
    step = interval or film.interval
    return evaluate(film, known, tracked, mean, count, step, remove_shake=remove_shake, points=points)


def _survey(film: Film, progress: ProgressMeter) -> tuple[NDArray[np.float32], int]:
    """Mean frame and number of frames."""
    total = np.zeros(film.shape)
    first: NDArray[np.float32] | None = None
    alike, count = True, 0
    with _work(progress, "reading the film", 0):
        for frame in film.frames():
            first = frame if first is None else first
            alike = alike and np.array_equal(frame, first)
            total += frame
            count += 1
            progress.advance()
    if count < FEWEST:
        raise InputError(
            f"holds {count} frames", file=str(film.path), expected=f"{FEWEST} at least", remedy="film longer"
        )
    if alike:
        raise InputError("all frames are equal: nothing moves, and there is no noise", file=str(film.path))
    return (total / count).astype(np.float32), count


def _track(
    film: Film,
    mean: NDArray[np.float32],
    count: int,
    tile: int | None,
    search: int | None,
    remove_shake: bool,
    progress: ProgressMeter,
) -> Tracked:
    corners, side, reach = grid_of_tiles(film.shape, tile, search)
    everywhere = Searcher(corners, side, reach)
    first = _references(film, everywhere, smoothed(mean))
    textured = texture_of(first)
    kept = np.flatnonzero(textured.along_x | textured.along_y | textured.edge)
    _require_texture(film, kept)
    with _work(progress, "templates", count):
        templates, found = _templates(film, Searcher(corners[kept], side, reach), first[kept], progress)
    texture = texture_of(templates)
    good = (texture.along_x | texture.along_y | texture.edge) & (found >= (1 - _LOSS) * count)
    kept, templates = kept[good], templates[good]
    _require_texture(film, kept)
    texture = texture_of(templates)
    moments = Moments(len(kept), count)
    follower = Follower(Searcher(corners[kept], side, reach), templates, texture)
    common = np.zeros((3, 2))
    with _work(progress, "displacements", count):
        for frame in film.frames():
            one = follower.follow(smoothed(frame))
            shared, known = _common(one, texture)
            common += np.stack([known, known * shared, known * shared**2])
            value = one.value - shared if remove_shake else one.value
            moments.take(value, one.noise, one.found)
            progress.advance()
    times = np.maximum(common[0], 1.0)
    rms = np.sqrt(np.maximum(common[2] / times - (common[1] / times) ** 2, 0.0))
    return Tracked(corners, side, reach, kept, texture, moments, rms)


def _require_texture(film: Film, kept: IntArray) -> None:
    if kept.size == 0:
        raise InputError(
            "no tile has texture that could be followed",
            file=str(film.path),
            remedy="film something with contrast in fine detail, or state another --tile or --search",
        )


def _references(film: Film, searcher: Searcher, mean: FloatArray) -> FloatArray:
    """For each tile its picture in one of the first frames: that which is most like the mean."""
    wanted = searcher.patches(mean, BORDER)
    wanted = wanted - wanted.mean((1, 2), keepdims=True)
    best = np.full(len(wanted), -np.inf)
    chosen = np.zeros_like(wanted)
    for frame in itertools.islice(film.frames(), _REFERENCES):
        patches = searcher.patches(smoothed(frame), BORDER)
        centred = patches - patches.mean((1, 2), keepdims=True)
        score = (centred * wanted).sum((1, 2)) / np.maximum(np.sqrt((centred**2).sum((1, 2))), 1e-12)
        better = score > best
        best[better], chosen[better] = score[better], patches[better]
    return np.asarray(chosen)


def _templates(
    film: Film, searcher: Searcher, first: FloatArray, progress: ProgressMeter
) -> tuple[FloatArray, FloatArray]:
    """Mean pictures of the tiles where they were found (K, h, h), and how often that was."""
    inner = slice(BORDER, -BORDER)
    wanted = searcher.transform(first[:, inner, inner])
    total, times = np.zeros(first.shape), np.zeros(len(first))
    for frame in film.frames():
        calm = smoothed(frame)
        value, _, found = searcher.find(calm, wanted)
        shown = warped(coefficients_of(calm), searcher, value, BORDER).reshape(first.shape)
        total[found] += shown[found]
        times += found
        progress.advance()
    return np.asarray(total / np.maximum(times, 1.0)[:, None, None]), times


def _common(one: Displacements, texture: Texture) -> tuple[FloatArray, FloatArray]:
    """Mean motion of the tiles along x and y, and whether there is one (1 or 0)."""
    shared, known = np.zeros(2), np.zeros(2)
    for axis, shows in enumerate((texture.along_x, texture.along_y)):
        chosen = shows & one.found
        if chosen.any():
            shared[axis], known[axis] = one.value[chosen, axis].mean(), 1.0
    return shared, known


@contextmanager
def _work(progress: ProgressMeter, label: str, total: int) -> Iterator[None]:
    progress.start(label, total)
    try:
        yield
    finally:
        progress.finish()
