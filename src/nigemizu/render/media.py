"""From air on a grid to what light passes on the device."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nigemizu import field
from nigemizu.errors import InputError
from nigemizu.field.types import Precision
from nigemizu.render.settings import Settings
from nigemizu.render.variant import current_backend
from nigemizu.trace import Tracer

__all__ = ["AirResolver", "Axes", "axes_of", "medium_of"]

Axes = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
AirResolver = Callable[[str, float], Axes]


def axes_of(settings: Settings, resolve_air: AirResolver | None) -> Axes:
    """The air named by the plug-in properties: x, y, z and refractivity.

    Raises
    ------
    InputError
        If the name is neither a dataset nor known to the resolver, or the dataset cannot be used.
    """
    # Late: the heat stage loads its compiler, which pictures without a dataset do not need.
    from nigemizu import heat
    from nigemizu.air import Atmosphere
    from nigemizu.heat.reading.crop import split_crop

    name = str(settings.air)
    if Path(split_crop(name)[0]).suffix.lower() in (".nc", ".zarr"):
        return heat.refractivity_at(heat.read_air(name), settings.time, Atmosphere())
    if resolve_air is not None:
        return resolve_air(name, settings.time)
    raise InputError(
        "no such air dataset", key="integrator nigemizu: air", value=name,
        expected="a path that ends in .nc or .zarr",
    )  # fmt: skip


def medium_of(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    z: NDArray[np.float64],
    refractivity: NDArray[np.float64],
    *,
    tracer: Tracer,
    precision: Precision = "single",
    storage: Precision | None = None,
    angle: float = 0.0,
    reach: float | None = None,
) -> Any:
    """Air on a grid as what the tracer's method wants: a volume, or panes cut from its mean profile.

    Parameters
    ----------
    x, y, z : (nx,), (ny,), (nz,) float64, m
        Axes, as from `nigemizu.heat.refractivity_at`.
    refractivity : (nz, ny, nx) float64, 1
        n − 1.
    tracer : Tracer
        Method, interpolation, what lies beyond the sides, and the panes.
    precision : {"single", "double"}
        Precision where the tracer leaves it open ("auto"): single for pictures, double for rays as data.
    storage : {"single", "double"}, optional
        Precision of the voxels; default: that of the positions.
    angle : float, rad
        By how much a ray across the whole volume may turn otherwise, so that still air is crossed in one go.
    reach : float, m, optional
        How far air goes on beyond its sides; for the interpolation "stratified" alone.
    """
    if tracer.precision != "auto":
        precision = tracer.precision
    types = field.types(current_backend(), precision, differentiable=True)
    if tracer.method == "layered":
        return field.Layers.from_profile(
            z,
            refractivity.mean(axis=(1, 2)),
            tracer.layers,
            types,
            spacing=tracer.layer_spacing,
            waviness_amplitude=tracer.waviness_amplitude,
            waviness_length=tracer.waviness_length,
            waviness_seed=tracer.waviness_seed,
        )
    axes = (x, y, z, refractivity, types)
    if tracer.interpolation == "tricubic":
        return field.TricubicVolume(*axes, beyond=tracer.beyond, storage=storage)
    across = max(float(np.hypot(x[-1] - x[0], y[-1] - y[0])), 1.0) if reach is None else reach
    options: dict[str, Any] = {"beyond": tracer.beyond, "flatness": angle / across, "storage": storage}
    if tracer.interpolation == "trilinear":
        return field.TrilinearVolume(*axes, **options)
    if reach is not None:
        options["reach"] = reach
    return field.StratifiedVolume(*axes, **options)
