"""Rendering in passes, to a picture with an account of how its rays ended."""

from __future__ import annotations

import signal
import threading
import time
from dataclasses import dataclass
from typing import Any, Final, final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from nigemizu.errors import InputError
from nigemizu.progress import SILENT, ProgressMeter
from nigemizu.render.path_tracer import STATUSES
from nigemizu.render.report import ErrorReport

__all__ = ["Picture", "picture"]

_PASS_RAYS: Final = 2**22  # rays per pass: a pass takes a second or so, and little memory


@final
@dataclass(frozen=True)
class Picture:
    """A rendered picture.

    Parameters
    ----------
    radiance : (height, width, 3) float32
        Linear red, green, blue; row 0 is the top.
    statuses : dict of str to int
        Number of camera rays per status: ``hit``, ``escaped``, ``out-of-steps``. Empty when the scene's
        integrator is not nigemizu's.
    samples : int
        Rays per pixel.
    seconds : float
        Time that the rays took, compilation included.
    report : ErrorReport or None
        Their errors; None where the scene's integrator is not nigemizu's, or bends nothing.
    """

    radiance: NDArray[np.float32]
    statuses: dict[str, int]
    samples: int
    seconds: float
    report: ErrorReport | None = None


def picture(
    scene: Any,
    *,
    samples: int,
    seed: int = 0,
    frame: int = 0,
    exposure: float = 0.0,
    progress: ProgressMeter = SILENT,
) -> Picture:
    """Render a Mitsuba scene in passes of a few samples per pixel.

    Parameters
    ----------
    scene : mi.Scene
        From `build`, or loaded by Mitsuba; rendered with its own integrator and first sensor.
    samples : int
        Rays per pixel.
    seed, frame : int
        Each (seed, frame, pass) draws its own random numbers, on whichever worker it is rendered.
    exposure : float, stops
        Factor 2^exposure on the radiance.
    progress : ProgressMeter
        Advances by the samples per pixel of each pass; interruptible between passes.

    Returns
    -------
    Picture
    """
    if samples < 1:
        raise InputError("at least one sample per pixel is needed", key="samples", value=samples)
    began = time.perf_counter()
    integrator, sensor = scene.integrator(), scene.sensors()[0]
    counted = hasattr(integrator, "reset_counts")
    if counted:
        integrator.reset_counts()
        integrator.planned = samples
    width, height = (int(length) for length in sensor.film().crop_size())
    total = np.zeros((height, width, 3), dtype=np.float64)
    progress.start("rendering", samples)
    try:
        for index, count in enumerate(_passes(samples, width * height)):
            state = np.random.SeedSequence([seed, frame, index]).generate_state(1)[0]
            # Opaque: a number known to the compiler would be compiled in, again for every pass.
            opaque = dr.opaque(mi.UInt32, int(state))
            image = integrator.render(scene, sensor, seed=opaque, spp=count)
            _take_interrupts_back()
            if integrator.should_stop():  # Mitsuba keeps Ctrl-C to itself while it renders
                raise KeyboardInterrupt
            total += np.asarray(image, dtype=np.float64)[..., :3] * count
            progress.advance(count)
    finally:
        progress.finish()
    counts = np.asarray(integrator.counts) if counted else ()
    radiance = np.asarray(total * (2.0**exposure / samples), dtype=np.float32)
    return Picture(
        radiance=radiance,
        statuses={name: int(number) for name, number in zip(STATUSES, counts, strict=False)},
        samples=samples,
        seconds=time.perf_counter() - began,
        report=integrator.report(scene, sensor) if counted else None,
    )


def _take_interrupts_back() -> None:
    """Mitsuba's own handler of Ctrl-C outlives the rendering and drops what is pressed after it."""
    handler = signal.getsignal(signal.SIGINT)
    if handler is not None and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, handler)


def _passes(samples: int, pixels: int) -> list[int]:
    """Samples per pixel of each pass: equal as far as possible, so that one kernel serves them all."""
    most = max(1, min(samples, _PASS_RAYS // pixels))
    whole, rest = divmod(samples, most)
    return [most] * whole + ([rest] if rest else [])
