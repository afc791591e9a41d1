"""Measurements to files: tables for people who compute, a figure for people who look."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from nigemizu.errors import InputError
from nigemizu.output.files import ready_to_write, whole_file, write_bytes
from nigemizu.output.provenance import Provenance

if TYPE_CHECKING:
    import xarray as xr

    from nigemizu.measure.result import Measurement

__all__ = ["SUFFIXES", "save", "to_dataset"]

SUFFIXES: Final = (".csv", ".nc", ".png", ".svg", ".pdf")


def save(measured: Measurement, path: str | Path, *, command: str = "") -> Path:
    """Write what each tile gave (``.csv``, ``.nc``) or draw the whole (``.png``, ``.svg``, ``.pdf``).

    Parameters
    ----------
    measured : Measurement
    path : path
    command : str
        Kept in the file.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Unknown extension, or the file cannot be written.
    MachineError
        The disk is full.
    """
    target = ready_to_write(path, SUFFIXES)
    suffix = target.suffix.lower()
    if suffix == ".csv":
        return write_bytes(target, _csv(measured).encode())
    provenance = Provenance(command=command)
    if suffix == ".nc":
        dataset = to_dataset(measured).assign_attrs(
            {name.lower(): text for name, text in provenance.fields().items()}
        )
        encoding = {str(name): {"_FillValue": None} for name in dataset.variables}
        with whole_file(target) as temporary:
            dataset.to_netcdf(temporary, engine="netcdf4", encoding=encoding)
        return target
    return _draw(measured, target, provenance)


def _csv(measured: Measurement) -> str:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(
        ["x_pixel", "y_pixel", "kind", "variance_x_rad2", "variance_y_rad2", "noise_x_rad2", "noise_y_rad2",
         "lost", "radius_pixel"]
    )  # fmt: skip
    t = measured.tiles
    for index, kind in enumerate(t.kind):
        numbers = [*t.variance[index], *t.noise[index], t.lost[index], t.radius[index]]
        shown = ["" if math.isnan(one) else f"{one:.9g}" for one in numbers]
        table.writerow([f"{t.place[index, 0]:g}", f"{t.place[index, 1]:g}", kind, *shown])
    return text.getvalue()


def to_dataset(measured: Measurement) -> xr.Dataset:
    """Tiles, structure function, autocorrelation and spectrum as one dataset; quantities as attributes."""
    import xarray as xr

    t, s, temporal = measured.tiles, measured.separations, measured.temporal
    rad2 = {"units": "rad2"}
    axis = ("tile", "axis")
    variables: dict[str, Any] = {
        "kind": ("tile", np.array(t.kind, dtype=str)),
        "variance": (axis, t.variance, rad2 | {"long_name": "variance of the angle of arrival"}),
        "noise": (axis, t.noise, rad2 | {"long_name": "variance of the noise, taken off already"}),
        "lost": ("tile", t.lost, {"units": "1", "long_name": "share of frames in which it was not found"}),
        "radius": ("tile", t.radius, {"units": "pixel", "long_name": "radius of the disc of its texture"}),
        "difference_along": ("separation", s.along, rad2),
        "difference_across": ("separation", s.across, rad2),
        "autocorrelation": ("lag", temporal.correlation, {"units": "1"}),
        "power": ("frequency", temporal.power, {"units": f"rad2 {temporal.unit}"}),
    }
    if s.along_theory is not None and s.across_theory is not None:
        variables["difference_along_theory"] = ("separation", s.along_theory, rad2)
        variables["difference_across_theory"] = ("separation", s.across_theory, rad2)
    coordinates: dict[str, Any] = {
        "x": ("tile", t.place[:, 0], {"units": "pixel", "long_name": "column of the middle of the tile"}),
        "y": ("tile", t.place[:, 1], {"units": "pixel", "long_name": "row of the middle of the tile"}),
        "axis": ("axis", np.array(["x", "y"])),
        "separation": ("separation", s.angle, {"units": "rad"}),
        "lag": ("lag", temporal.lag, {"units": temporal.unit}),
        "frequency": ("frequency", temporal.frequency, {"units": f"{temporal.unit}-1"}),
    }
    attributes: dict[str, Any] = {"film": str(measured.film), "frames": measured.frames}
    for one in measured.quantities:
        attributes[one.name] = one.value
        attributes[f"{one.name}_units"] = one.unit
        if not math.isnan(one.low):
            attributes[f"{one.name}_interval"] = [one.low, one.high]
        if one.theory is not None:
            attributes[f"{one.name}_theory"] = one.theory
    return xr.Dataset(variables, coordinates, attributes)


def _draw(measured: Measurement, target: Path, provenance: Provenance) -> Path:
    from nigemizu.output.shimmer import ShimmerFigure, shimmer_figure

    if not measured.separations.angle.size and not np.isfinite(measured.tiles.variance).any():
        raise InputError("there is nothing to draw", file=str(target))
    with np.errstate(invalid="ignore"):
        rms = 1e6 * np.sqrt(np.maximum(_mean_of_axes(measured.tiles.variance), 0.0))
    s, temporal = measured.separations, measured.temporal
    best = next(one for one in measured.quantities if one.name in ("cn2", "cn2_differential"))
    title = f"{measured.film.name}: Cn² = {best.value:.2e} m$^{{-2/3}}$"
    if not math.isnan(best.low):
        title += f" ({best.low:.2e} to {best.high:.2e})"
    if best.theory is not None:
        title += f", stated {best.theory:.2e}"
    figure = ShimmerFigure(
        picture=measured.picture,
        places=measured.tiles.place,
        side=measured.tile,
        rms=rms,
        separation=s.angle,
        along=s.along,
        across=s.across,
        along_theory=s.along_theory,
        across_theory=s.across_theory,
        lag=temporal.lag,
        correlation=temporal.correlation,
        frequency=temporal.frequency,
        power=temporal.power,
        white=temporal.white,
        unit=temporal.unit,
        title=title,
    )
    return shimmer_figure(target, figure, provenance=provenance)


def _mean_of_axes(variance: np.ndarray) -> np.ndarray:
    known = np.isfinite(variance)
    total = np.where(known, variance, 0.0).sum(1)
    return np.where(known.any(1), total / np.maximum(known.sum(1), 1), np.nan)
