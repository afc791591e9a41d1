"""Rendering in passes, to a picture with an account of how its rays ended."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterable
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

__all__ = ["Picture", "Shot", "picture"]

_PASS_RAYS: Final = 2**22  # rays per pass: a pass takes a second or so, and little memory


@final
@dataclass(frozen=True)
class Shot:
    """A part of a picture: its share of the samples, seen from its own sensor.

    Parameters
    ----------
    samples : int
        Rays per pixel.
    sensor : mi.Sensor, optional
        Default: the scene's first.
    weight : float
        Share in the picture, relative to the others.
    """

    samples: int
    sensor: Any = None
    weight: float = 1.0


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
        Their errors; None where the scene's integrator is not nigemizu's, or bends nothing, or
        where they were not measured.
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
    shots: Iterable[Shot] | None = None,
    measured: bool = True,
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
    shots : iterable of Shot, optional
        Parts that the picture is the weighted mean of, with `samples` rays per pixel together. Each is taken
        from the iterable when those before it are rendered, so that a generator can put other air in between.
        Default: one shot.
    measured : bool
        Whether the errors of the rays are measured.
    progress : ProgressMeter
        Advances by the samples per pixel of each pass; interruptible between passes.

    Returns
    -------
    Picture
        Its report is the joined one of the first, second, fourth, eighth … shot.
    """
    if samples < 1:
        raise InputError("at least one sample per pixel is needed", key="samples", value=samples)
    began = time.perf_counter()
    exposing = _Exposing(scene, [seed, frame], measured, progress)
    progress.start("rendering", samples)
    try:
        for shot in (Shot(samples),) if shots is None else shots:
            exposing.add(shot, 2.0**exposure)
    finally:
        progress.finish()
    counts = exposing.counts()
    return Picture(
        radiance=np.asarray(exposing.total / exposing.weight, dtype=np.float32),
        statuses={name: int(number) for name, number in zip(STATUSES, counts, strict=False)},
        samples=samples,
        seconds=time.perf_counter() - began,
        report=ErrorReport.joined(exposing.reports) if exposing.reports else None,
    )


@final
class _Exposing:
    """A picture under way: light is added, shot by shot and pass by pass."""

    def __init__(self, scene: Any, seeds: list[int], measured: bool, progress: ProgressMeter) -> None:
        self._scene, self._seeds, self._progress = scene, seeds, progress
        self._measured = measured
        self._integrator, self._sensor = scene.integrator(), scene.sensors()[0]
        self._counted = hasattr(self._integrator, "reset_counts")
        if self._counted:
            self._integrator.reset_counts()
        width, height = (int(length) for length in self._sensor.film().crop_size())
        self._passes, self._shots = 0, 0
        self.total = np.zeros((height, width, 3), dtype=np.float64)
        self.weight = 0.0
        self.reports: list[ErrorReport] = []

    def add(self, shot: Shot, factor: float) -> None:
        """Render a shot; `factor` multiplies its light."""
        sensor = self._sensor if shot.sensor is None else shot.sensor
        height, width, _ = self.total.shape
        if self._counted:
            self._integrator.planned = shot.samples
        part = np.zeros_like(self.total)
        for count in _passes(shot.samples, width * height):
            part += self._pass(sensor, count) * count
        self.total += part * (shot.weight * factor / shot.samples)
        self.weight += shot.weight
        self._shots += 1
        # Measuring takes as long as some passes: with many shots it is done for ever fewer of them.
        if self._measured and self._counted and self._shots & (self._shots - 1) == 0:
            report = self._integrator.report(self._scene, sensor)
            self.reports += [] if report is None else [report]

    def counts(self) -> Any:
        """Camera rays per entry of `STATUSES`."""
        return np.asarray(self._integrator.counts) if self._counted else ()

    def _pass(self, sensor: Any, count: int) -> NDArray[np.float64]:
        state = np.random.SeedSequence([*self._seeds, self._passes]).generate_state(1)[0]
        # Opaque: a number known to the compiler would be compiled in, again for every pass.
        opaque = dr.opaque(mi.UInt32, int(state))
        image = self._integrator.render(self._scene, sensor, seed=opaque, spp=count)
        _take_interrupts_back()
        if self._integrator.should_stop():  # Mitsuba keeps Ctrl-C to itself while it renders
            raise KeyboardInterrupt
        self._passes += 1
        self._progress.advance(count)
        return np.asarray(image, dtype=np.float64)[..., :3]


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
