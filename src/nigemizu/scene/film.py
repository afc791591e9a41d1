"""The film: the air streams past, instant by instant, and every frame that is not there yet is rendered."""

from __future__ import annotations

import functools
import itertools
import multiprocessing
import os
import shutil
import signal
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from nigemizu.errors import InputError, MachineError
from nigemizu.progress import SILENT, ProgressMeter
from nigemizu.scene.digest import air_digest
from nigemizu.scene.rendering import Studio, warn_of_errors, warn_of_lost_rays
from nigemizu.scene.running import AirSource, AirVolume, Variant, air_instants, open_air, require_within

if TYPE_CHECKING:
    from nigemizu.output import FrameFolder
    from nigemizu.render.report import ErrorReport
    from nigemizu.scene.model import Scene

__all__ = ["Tell", "animate", "frames_folder"]

_Air: TypeAlias = AirVolume | tuple[AirVolume, ...] | None
_Job: TypeAlias = "tuple[int, _Air, Path, Path | None]"
_Outcome: TypeAlias = "tuple[dict[str, int], ErrorReport | None]"
Tell: TypeAlias = "Callable[[Mapping[str, int], ErrorReport | None], None]"

_MEASURED: Final = 4  # every so many frames of a film the errors of its rays are measured


def animate(
    scene: Scene,
    path: Path,
    air: AirSource,
    workers: int,
    variant: Variant,
    command: str,
    progress: ProgressMeter,
    tell: Tell | None = None,
    *,
    truth: bool = False,
) -> Path:
    """See `nigemizu.scene.Scene.animate`."""
    from nigemizu.output import FrameFolder, Provenance, ready_to_write, write_film
    from nigemizu.render import select_variant

    scene.check()
    select_variant(variant)  # refused here, before anything is written
    path = ready_to_write(path, (".mp4", ".gif", ".webp"))
    _require_instants(scene, air)
    provenance = Provenance(scene=scene.to_toml(), command=command)
    # How fast the film plays, and what it is called, changes no frame.
    shown = scene.model_copy(
        update={"title": "", "description": "", "film": scene.film.model_copy(update={"fps": 1})}
    )
    digest = air_digest(air)
    folder = FrameFolder(
        frames_folder(path),
        scene.film.frames,
        Provenance(scene=shown.to_toml()),
        inputs=None if digest is None else {"air": digest},
    )
    truths = path.with_name(f"{path.stem}_truth") if truth else None
    missing = _missing(folder, truths)
    progress.start("frames", folder.count)
    progress.advance(folder.count - len(missing))
    jobs = _jobs(scene, folder, missing, air, truths, variant)
    if workers == 1:
        outcomes = _render_here(scene, jobs, variant, progress)
    else:
        outcomes = _render_in_processes(scene, jobs, variant, workers, progress)
    progress.finish()
    shutil.rmtree(_air_folder(folder.path), ignore_errors=True)
    statuses, report = _joined(outcomes)
    warn_of_lost_rays(statuses, scene)
    if report is not None:
        warn_of_errors(report, scene)
    if tell is not None:
        tell(statuses, report)
    return write_film(path, folder.frames(), fps=scene.film.fps, provenance=provenance, progress=progress)


def frames_folder(path: Path) -> Path:
    """Where the numbered frames of the film `path` lie."""
    return path.with_name(f"{path.stem}_frames")


def _air_folder(frames: Path) -> Path:
    """Where air that moves by itself is kept while the film is not complete."""
    return frames.with_name(f"{frames.name}_air")


def _require_instants(scene: Scene, air: AirSource) -> None:
    """Refuse what cannot be shown before the first frame is rendered and anything is written."""
    exposures = _exposures(scene)
    if isinstance(air, AirVolume):
        return
    if air is not None:
        require_within(open_air(air), tuple(itertools.chain(*exposures)))
    elif scene.tracer.method != "straight" and scene.heated is not None:
        scene.heated.initial.sample(scene.heated.grid.build())


def _missing(folder: FrameFolder, truths: Path | None) -> list[int]:
    """Frames that are not there yet, or whose ground truth is not."""
    if truths is None:
        return folder.missing()
    truths.mkdir(exist_ok=True)
    there = {path.stem for path in truths.glob("*.nc")} & {path.stem for path in truths.glob("*.exr")}
    absent = {number for number, frame in enumerate(folder.frames()) if frame.stem not in there}
    return sorted(absent | set(folder.missing()))


def _jobs(
    scene: Scene,
    folder: FrameFolder,
    missing: Sequence[int],
    air: AirSource,
    truths: Path | None,
    variant: Variant,
) -> Iterator[_Job]:
    """The frames that are missing, with their air.

    The heat stage runs from the beginning even when only the last frame is missing, or from a checkpoint of
    air that moves by itself: a frame is the same whether the film was interrupted before it or not.
    """
    if not missing:
        return
    if scene.tracer.method == "straight":
        yield from (_job(scene, folder, index, None, truths) for index in missing)
        return
    wanted = frozenset(missing)
    exposures = _exposures(scene)
    each = len(exposures[0])
    times = tuple(itertools.chain(*exposures[: missing[-1] + 1]))
    kept = _air_folder(folder.path)
    first = each * missing[0]
    instants = air_instants(scene, times, air, SILENT, first=first, folder=kept, variant=variant)
    for index in range(missing[0], missing[-1] + 1):
        airs = tuple(itertools.islice(instants, each))
        if index in wanted:
            yield _job(scene, folder, index, airs[0] if each == 1 else airs, truths)


def _job(scene: Scene, folder: FrameFolder, index: int, air: _Air, truths: Path | None) -> _Job:
    frame = folder.frame(index)
    return index, air, frame, None if truths is None else truths / frame.stem


def _take(studio: Studio, job: _Job, progress: ProgressMeter) -> _Outcome:
    """Render a frame; it is written last, so that one that is there is complete."""
    import drjit

    index, air, frame, truth = job
    time = studio.scene.film.times[index]
    # Neighbouring frames err alike, and measuring takes as long as some samples.
    measured = index % _MEASURED == 0
    picture = studio.shoot(air, frame=index, time=time, measured=measured, progress=progress)
    if truth is not None:
        studio.truth(picture, air, time, frame=index).save(truth)
    picture.save(frame)
    drjit.flush_malloc_cache()  # arrays of other sizes follow; kept, those of a long film would add up
    return picture.statuses, picture.report


def _exposures(scene: Scene) -> list[tuple[float, ...]]:
    """The instants [s] of the air that each frame looks through.

    Raises
    ------
    InputError
        If a frame is exposed for longer than it takes to the next.
    """
    exposures = [scene.camera.instants(time) for time in scene.film.times]
    for one, other in itertools.pairwise(exposures):
        if other[0] <= one[-1]:
            raise InputError(
                "is longer than a frame of the film",
                key="camera.shutter",
                value=scene.camera.shutter,
                expected=f"less than {scene.film.times[1] - scene.film.times[0]:.4g} s",
            )
    return exposures


def _joined(outcomes: Sequence[_Outcome]) -> _Outcome:
    """Of all frames together what is said of one picture."""
    statuses: Counter[str] = Counter()
    for outcome in outcomes:
        statuses.update(outcome[0])
    reports = [outcome[1] for outcome in outcomes if outcome[1] is not None]
    return dict(statuses), type(reports[0]).joined(reports) if reports else None


def _render_here(
    scene: Scene, jobs: Iterator[_Job], variant: Variant, progress: ProgressMeter
) -> list[_Outcome]:
    studio: Studio | None = None
    outcomes = []
    for job in jobs:
        studio = studio or Studio(scene, variant)
        outcomes.append(_take(studio, job, progress))
        progress.advance()
    return outcomes


def _render_in_processes(
    scene: Scene, jobs: Iterator[_Job], variant: Variant, workers: int, progress: ProgressMeter
) -> list[_Outcome]:
    """Few instants are under way at once, so that the air of a long film is never held as a whole."""
    threads = max(1, (os.cpu_count() or 1) // workers)
    toml = scene.to_toml()
    outcomes: list[_Outcome] = []
    with _pool(workers) as pool:
        waiting: set[Future[_Outcome]] = set()
        for job in jobs:
            if len(waiting) >= 2 * workers:
                waiting = _collect(waiting, outcomes, progress)
            waiting.add(pool.submit(_render_one, toml, variant, threads, job))
        while waiting:
            waiting = _collect(waiting, outcomes, progress)
    return outcomes


def _collect(
    waiting: set[Future[_Outcome]], outcomes: list[_Outcome], progress: ProgressMeter
) -> set[Future[_Outcome]]:
    done, rest = wait(waiting, return_when=FIRST_COMPLETED)
    for future in done:
        try:
            outcomes.append(future.result())
        except BrokenProcessPool as error:
            raise MachineError(
                "a rendering process was killed, perhaps for want of memory; use fewer --workers"
            ) from error
        progress.advance()
    return rest


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    # Spawned, not forked: neither Mitsuba nor the compiler's threads survive a fork.
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_prepare_process)
    finished = False
    try:
        yield pool
        finished = True
    finally:
        if not finished:
            # Frames are written whole or not at all, so that their renderers need not be waited for.
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)


def _prepare_process() -> None:
    # Ctrl-C reaches every process of a terminal; the parent decides for all, and speaks for all.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")


def _render_one(toml: str, variant: Variant, threads: int, job: _Job) -> _Outcome:
    return _take(_studio(toml, variant, threads), job, SILENT)


@functools.cache
def _studio(toml: str, variant: Variant, threads: int) -> Studio:
    import drjit

    from nigemizu.scene.model import Scene

    drjit.set_thread_count(threads)
    return Studio(Scene.from_toml(toml), variant)
