"""The verbs, each a few lines over `nigemizu.scene`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nigemizu.cli import tables
from nigemizu.cli.meter import meter
from nigemizu.cli.stats import Stats
from nigemizu.errors import InputError

if TYPE_CHECKING:
    from nigemizu.scene import Scene

__all__ = [
    "animate",
    "bench",
    "check",
    "doctor",
    "measure",
    "render",
    "scenes",
    "schema",
    "show",
    "simulate",
    "trace",
]

# Flags that replace one value of the scene: attribute of the options → key of the scene.
_FLAG_KEYS = {
    "samples": "camera.samples",
    "seed": "camera.seed",
    "method": "tracer.method",
    "start": "film.start",
    "frames": "film.frames",
    "fps": "film.fps",
    "every": "time.store_every",
}


def render(options: argparse.Namespace) -> int:
    """``nigemizu render``."""
    from nigemizu.cli.doctor import demand_backend
    from nigemizu.output import ready_to_write

    scene = _scene(options)
    common: dict[str, Any] = {"time": options.time, "air": options.air, "variant": options.variant}
    output = ready_to_write(_output(options, ".png"), (".png",) if options.compare else (".png", ".exr"))
    if options.compare and options.truth:
        raise InputError("--truth is of one picture", key="--compare", remedy="leave one of them out")
    if options.compare and options.stats:
        raise InputError("--stats tells of one picture", key="--compare", remedy="leave one of them out")
    demand_backend(options.variant)
    _use_threads(options.threads)
    stats = Stats()
    with _naming(options.scene), meter(quiet=options.quiet) as progress:
        if options.compare:
            written = scene.compare(output, **common, command=options.command, progress=progress)
        else:
            picture = scene.render(**common, truth=options.truth, progress=progress)
            written = [picture.save(output, command=options.command)]
            stats.take(picture.statuses, picture.report)
    if options.stats:
        print(stats, file=sys.stderr)
    print(*written, sep="\n")
    return 0


def animate(options: argparse.Namespace) -> int:
    """``nigemizu animate``."""
    from nigemizu.cli.doctor import demand_backend

    scene = _scene(options)
    demand_backend(options.variant)
    _use_threads(options.threads)
    stats = Stats()
    with _naming(options.scene), meter(quiet=options.quiet) as progress:
        written = scene.animate(
            _output(options, ".mp4"),
            air=options.air,
            workers=options.workers,
            variant=options.variant,
            command=options.command,
            progress=progress,
            tell=stats.take,
            truth=options.truth,
        )
    if options.stats:
        print(stats, file=sys.stderr)
    print(written)
    return 0


def simulate(options: argparse.Namespace) -> int:
    """``nigemizu simulate``."""
    from nigemizu.output import ready_to_write

    scene = _scene(options)
    output = ready_to_write(_output(options, ".zarr"), (".zarr", ".nc"))
    _use_threads(options.threads)
    with _naming(options.scene), meter(quiet=options.quiet) as progress:
        written = scene.save_air(output, variant=options.variant, command=options.command, progress=progress)
    print(written)
    return 0


def trace(options: argparse.Namespace) -> int:
    """``nigemizu trace``."""
    from nigemizu.cli.doctor import demand_backend
    from nigemizu.output import ready_to_write

    scene = _scene(options)
    if options.table is not None:
        _use_threads(options.threads)
        with _naming(options.scene), meter(quiet=options.quiet) as progress:
            return tables.run(options, scene, progress)
    tables.require_table(options)
    if options.output is not None:
        ready_to_write(options.output, (".csv", ".nc", ".png", ".svg"))
    elif not options.json:
        raise InputError(
            "nothing to write", key="trace", remedy="add --json, or -o rays.svg (.png, .csv, .nc)"
        )
    demand_backend(options.variant)
    _use_threads(options.threads)
    with _naming(options.scene), meter(quiet=options.quiet) as progress:
        rays = scene.trace(
            options.elevation,
            options.azimuth,
            time=options.time,
            air=options.air,
            paths=options.output is not None,
            variant=options.variant,
            progress=progress,
        )
        if options.output is not None:
            written = rays.save(options.output, command=options.command)
            print(written, file=sys.stderr if options.json else sys.stdout)
    if options.json:
        print(json.dumps(rays.as_records(), indent=1, allow_nan=False))
    return 0


def measure(options: argparse.Namespace) -> int:
    """``nigemizu measure``."""
    from nigemizu.measure import measure_film
    from nigemizu.measure.saving import SUFFIXES, save
    from nigemizu.output import ready_to_write

    for output in options.output:
        ready_to_write(output, SUFFIXES)
    if options.fps is not None and not options.fps > 0:
        raise InputError("impossible frame rate", key="--fps", value=options.fps, expected="above 0")
    optics = ("distance", "aperture", "pixel_angle", "focal_length", "pixel_pitch", "wavelength", "wave")
    more = ("inner_scale", "outer_scale", "cn2", "tile", "search", "remove_shake", "points")
    with meter(quiet=options.quiet) as progress:
        measured = measure_film(
            options.film,
            interval=None if options.fps is None else 1.0 / options.fps,
            progress=progress,
            **{name: getattr(options, name) for name in (*optics, *more)},
        )
        written = [save(measured, output, command=options.command) for output in options.output]
    if options.json:
        print(json.dumps(measured.as_dict(), indent=1, allow_nan=False, ensure_ascii=False))
    else:
        print(measured.table())
    for path in written:
        print(path, file=sys.stderr)
    return 0


def scenes(options: argparse.Namespace) -> int:
    """``nigemizu scenes``."""
    from nigemizu.cli.doctor import import_compiler

    import_compiler()
    from nigemizu.scene import builtin_scenes

    listed = builtin_scenes()
    width = max(map(len, listed))
    for name, title in listed.items():
        print(f"{name:{width}}  {title}")
    return 0


def show(options: argparse.Namespace) -> int:
    """``nigemizu show``."""
    print(_scene(options).to_toml(comments=not options.plain), end="")
    return 0


def check(options: argparse.Namespace) -> int:
    """``nigemizu check``."""
    scene_class, overrides = _scene_class(), _overrides(options)
    for name in options.scene:
        scene = scene_class.load(name, overrides)
        with _naming(name):
            scene.check()
        cells = [] if scene.grid is None else [f"{'×'.join(map(str, scene.grid.cells))} cells"]
        parts = [scene.title or "untitled", ", ".join([*cells, f"{len(scene.objects)} objects"])]
        print(f"{name}: valid ({'; '.join(parts)})")
    return 0


def schema(options: argparse.Namespace) -> int:
    """``nigemizu schema``."""
    print(json.dumps(_scene_class().json_schema(), indent=2, ensure_ascii=False))
    return 0


def doctor(options: argparse.Namespace) -> int:
    """``nigemizu doctor``."""
    from nigemizu.cli.doctor import examine, report

    found = examine()
    print(json.dumps(found, indent=2) if options.json else report(found))
    return 0 if found["can_render"] else 2


def bench(options: argparse.Namespace) -> int:
    """``nigemizu bench``."""
    from nigemizu.cli.bench import run_all, table
    from nigemizu.cli.doctor import demand_backend

    demand_backend("llvm")
    results = run_all()
    print(json.dumps(results, indent=2) if options.json else table(results))
    return 0


def _scene_class() -> type[Scene]:
    from nigemizu.cli.doctor import import_compiler

    import_compiler()  # a scene names the stages, which need it
    from nigemizu.scene import Scene

    return Scene


def _scene(options: argparse.Namespace) -> Scene:
    return _scene_class().load(options.scene, _overrides(options))


@contextmanager
def _naming(file: str) -> Iterator[None]:
    """Let errors about the scene say which file it came from."""
    try:
        yield
    except InputError as error:
        raise error.in_file(file) from error


def _overrides(options: argparse.Namespace) -> dict[str, Any]:
    from nigemizu.scene.reading import parse_assignment

    changes = dict(parse_assignment(text) for text in options.overrides)
    for flag, key in _FLAG_KEYS.items():
        if getattr(options, flag, None) is not None:
            changes[key] = getattr(options, flag)
    if getattr(options, "size", None) is not None:
        changes["camera.width"], changes["camera.height"] = options.size
    if getattr(options, "duration", None) is not None:
        changes["film.duration" if options.verb == "animate" else "time.duration"] = options.duration
    return changes


def _output(options: argparse.Namespace, suffix: str) -> Path:
    return Path(options.output) if options.output is not None else Path(Path(options.scene).stem + suffix)


def _use_threads(count: int | None) -> None:
    """Limit the threads of the compiled loops of both stages."""
    if count is None:
        return
    import drjit
    import numba

    drjit.set_thread_count(count)
    numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
