"""``nigemizu trace --table``: refraction, the horizon, and transfer curves as tables."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from nigemizu.errors import InputError

if TYPE_CHECKING:
    from nigemizu.progress import ProgressMeter
    from nigemizu.scene import Scene

__all__ = ["add_flags", "require_table", "run"]

_OWN: Final = ("distance", "height", "wavelength")
_FLAGS: Final = {
    "refraction": {"elevation", "wavelength"},
    "horizon": {"height"},
    "transfer": {"distance", "elevation", "azimuth", "time", "air", "method"},
}
"""What each table understands of the flags that one or the other does."""

_REMEDIES: Final = {
    "wavelength": "set it with --set air.wavelength=590e-9",
    "height": "set the eye with --set camera.eye.2=10",
    "azimuth": "air in layers is the same all around",
    "time": "air in layers does not change",
    "air": "air in layers is that of the section [profile]",
    "method": "the integral is that of bent light",
    "distance": "it goes with --table transfer",
    "elevation": "the horizon has the elevation that the table gives",
}


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Give the verb ``trace`` the flags of the tables."""
    parser.add_argument(
        "--table",
        choices=tuple(_FLAGS),
        help="in place of rays: refraction of the stars, dip and distance of the horizon, or which height "
        "of a distant object is seen where",
    )
    parser.add_argument(
        "--wavelength", type=_list("m"), metavar="METRES", help="of a table of refraction: list, 400nm,700nm"
    )
    parser.add_argument(
        "--height", type=_list("m"), metavar="METRES", help="of the eye, in a table of the horizon: list"
    )
    parser.add_argument(
        "--distance", type=_list("m"), metavar="METRES", help="of the object of a transfer curve, 16.8km"
    )


def require_table(options: argparse.Namespace) -> None:
    """Refuse flags of the tables where no table was asked for."""
    for name in _OWN:
        if getattr(options, name) is not None:
            table = next(table for table, flags in _FLAGS.items() if name in flags)
            raise InputError("belongs to a table", key=f"--{name}", remedy=f"add --table {table}")


def run(options: argparse.Namespace, scene: Scene, progress: ProgressMeter) -> int:
    """Make the table that was asked for, and print it or write it."""
    from nigemizu.cli.doctor import demand_backend
    from nigemizu.output import ready_to_write
    from nigemizu.scene.measuring.columns import FIGURES, SUFFIXES

    _check(options)
    if options.output is not None:
        figures = options.table != "horizon"
        ready_to_write(options.output, tuple(kind for kind in SUFFIXES if figures or kind not in FIGURES))
    if options.table == "transfer":
        demand_backend(options.variant)
    made = _made(options, scene, progress)
    if options.output is not None:
        written = made.save(options.output, command=options.command)
        print(written, file=sys.stderr if options.json else sys.stdout)
    if options.json:
        print(json.dumps(made.as_dict(), indent=1, allow_nan=False, ensure_ascii=False))
    elif options.output is None:
        print(made.table(rays=options.elevation is not None) if options.table == "transfer" else made.table())
    return 0


def _made(options: argparse.Namespace, scene: Scene, progress: ProgressMeter) -> Any:
    from nigemizu.scene import measuring

    if options.table == "refraction":
        return measuring.refraction_table(scene, options.elevation, options.wavelength)
    if options.table == "horizon":
        return measuring.horizon_table(scene, options.height)
    return measuring.transfer_curve(
        scene,
        options.distance[0],
        options.elevation,
        options.azimuth[0] if options.azimuth is not None else 0.0,
        time=options.time,
        air=options.air,
        variant=options.variant,
        progress=progress,
    )


def _check(options: argparse.Namespace) -> None:
    own = _FLAGS[options.table]
    for name in sorted(set().union(*_FLAGS.values()) - own):
        if getattr(options, name) is not None:
            raise InputError(f"a table of {options.table} does not know it", key=f"--{name}",
                             remedy=f"leave it out; {_REMEDIES[name]}")  # fmt: skip
    if options.table != "transfer":
        return
    if options.distance is None:
        raise InputError(
            "a transfer curve wants the distance of the object", key="--distance",
            remedy="add --distance 10km",
        )  # fmt: skip
    for name in ("distance", "azimuth"):
        given = getattr(options, name)
        if given is not None and len(given) != 1:
            raise InputError("a transfer curve has one", key=f"--{name}", value=given, expected="one number")


def _list(unit: str) -> Callable[[str], tuple[float, ...]]:
    """Reads numbers, each with or without a unit, between commas."""

    def read(text: str) -> tuple[float, ...]:
        from nigemizu.units import UnitError, to_unit

        try:
            return tuple(to_unit(part, unit) for part in text.split(","))
        except UnitError as error:
            raise argparse.ArgumentTypeError(f"{text!r} cannot be used; write {error}") from None

    return read
