"""The results as one table to read."""

from __future__ import annotations

from typing import Any, NamedTuple

__all__ = ["Row", "rows", "table"]


class Row(NamedTuple):
    """One line: what, how much, and against what in the same run."""

    what: str
    figure: str
    ratio: str = ""


def table(results: dict[str, Any]) -> str:
    """The machine, and a table of what `run_all` returned; the last column holds in a loaded machine too."""
    lines = rows(results)
    what = max(len(row.what) for row in lines if row.figure)  # others may reach into the next column
    figure = max(len(row.figure) for row in lines)
    heading = Row("", "measured", "beside another, in this run")
    body = [f"{row.what:{what}}  {row.figure:>{figure}}  {row.ratio}".rstrip() for row in (heading, *lines)]
    return "\n".join(
        [*_machine(results["machine"]), "", *body, "", f"measured in {results['seconds']:.0f} s"]
    )


def rows(results: dict[str, Any]) -> list[Row]:
    """The lines of the table."""
    return [
        *_picture("pyramid", results["pyramid"]),
        *_picture("road with fluctuations", results["road"]),
        *_march(results["march"]),
        _stratified(results["stratified"]),
        *_panes(results["panes"]),
        _ray_by_ray(results["ray_by_ray"]),
        *_heat(results["heat"]),
        _convection(results["convection"]),
        _film(results["film"]),
        *_memory(results["memory"]),
        *_growth(results["growth"]),
    ]


def _machine(machine: dict[str, Any]) -> list[str]:
    packages = ", ".join(f"{name} {version}" for name, version in machine["packages"].items())
    return [
        f"{machine['cores']} cores of {machine['processor']}, {machine['platform']}",
        f"nigemizu {machine['nigemizu']}, Python {machine['python']}, LLVM {machine['llvm']}, {packages}",
    ]


def _picture(name: str, found: dict[str, Any]) -> list[Row]:
    (width, height), (nx, ny, nz) = found["size"], found["nodes"]
    report = found["report"]
    told = [
        Row(f"  {what} per ray", "not reported" if report is None else f"{report[key]:.3g}")
        for what, key in (("steps", "steps_per_ray"), ("geometry queries", "queries_per_ray"))
    ]
    error = "not reported"
    if report is not None:
        error = f"{report['mean_error_pixels']:.2g} (worst {report['worst_error_pixels']:.2g}) pixel"
    timed = {
        "  Mitsuba's direct": "stock",
        "  bent, as direct": "bent_alike",
        "  straight, as direct": "straight_alike",
        "  bent, with haze and a bounce more": "bent",
        "  straight, with haze and a bounce more": "straight",
    }
    return [
        Row(f"{name}, {width}×{height}, {found['samples']} samples, {nx}×{ny}×{nz} nodes", ""),
        *(_timed(what, found, key) for what, key in timed.items()),
        *told,
        Row("  estimated displacement error", error),
    ]


def _timed(what: str, found: dict[str, Any], key: str) -> Row:
    over = found.get(f"{key}_over_stock")
    return Row(
        what, f"{found[f'{key}_seconds']:.2f} s", "" if over is None else f"{over:.2f} × Mitsuba's direct"
    )


def _march(found: dict[str, Any]) -> list[Row]:
    return [
        Row(
            f"march at a fixed step, {name} cells",
            f"{found[name] / 1e6:.0f} million ray-steps/s",
            f"{found[f'{name}_over_by_hand']:.2f} × a loop by hand, uniform cells",
        )
        for name in ("uniform", "stretched")
    ]


def _stratified(found: dict[str, Any]) -> Row:
    error = found["error_pixels"]
    told = "nothing came there" if error is None else f"worst error {error:.2g} pixel"
    return Row(
        f"stratified air, a wall at {found['distance'] / 1000:.0f} km, {found['pixels']:,} rays",
        f"{found['seconds']:.3f} s",
        f"{found['paths']:,} shared paths in {found['table_seconds']:.3f} s; {told}",
    )


def _panes(found: dict[str, Any]) -> list[Row]:
    name = f"panes that err by {found['equal_error_pixels']} pixel"
    law = f"error ∝ panes^-{found['order']:.2f}; ours is {found['bent_error_pixels']:.2g} pixel"
    if found["panes"] is None:
        return [Row(name, "none reach it", law)]
    beyond = " (extrapolated)" if found["extrapolated"] else ""
    measured = found["timed_panes_seconds"] / found["bent_seconds"]
    return [
        Row(name, f"{found['panes']:,.0f}{beyond}", law),
        Row(
            f"  their time, {found['rays']:,} rays",
            f"{found['panes_seconds']:.3g} s{beyond}",
            f"{found['panes_over_bent']:,.0f} × ours; {measured:.0f} × ours for {found['timed_panes']:,}",
        ),
    ]


def _ray_by_ray(found: dict[str, Any]) -> Row:
    return Row(
        f"SciPy's DOP853 ray by ray, rtol {found['rtol']:.0e}",
        f"{found['scipy_seconds_per_ray'] * 1e3:.3g} ms per ray",
        f"{found['scipy_over_bent']:,.0f} × ours",
    )


def _heat(found: dict[str, Any]) -> list[Row]:
    nx, ny, nz = found["cells"]
    return [
        Row(
            f"heat stage, {nx}×{ny}×{nz} cells",
            f"{found['cell_updates_per_second'] / 1e6:.1f} million cell-updates/s",
            f"{found['share_of_memory_copy']:.3f} × a memory copy of the same bytes",
        ),
        Row("  memory copy", f"{found['memory_copy_bytes_per_second'] / 1e9:.1f} GB/s"),
    ]


def _convection(found: dict[str, Any]) -> Row:
    nx, ny, nz = found["cells"]
    speed, card = found["cell_updates_per_second"], found.get("card_updates_per_second")
    return Row(
        f"convection, {nx}×{ny}×{nz} cells",
        f"{speed / 1e6:.1f} million cell-updates/s",
        f"holds {found['volumes']:.1f} volumes" + (f", {card / speed:.1f} × on the card" if card else ""),
    )


def _film(found: dict[str, Any]) -> Row:
    width, height = found["size"]
    return Row(
        f"film of the road, {width}×{height}, {found['samples']} samples, air included",
        f"{found['frames_per_minute']:.1f} frames/minute",
    )


def _memory(found: dict[str, Any]) -> list[Row]:
    if found["volumes"] is None:
        return [Row("peak memory of a picture", "not counted by this system")]
    return [
        Row(
            "peak memory of a picture",
            f"{found['volumes']:.1f} volumes",
            f"of float64 n, {found['base_bytes'] / 1e6:.0f} MB without any",
        )
    ]


def _growth(found: dict[str, float]) -> list[Row]:
    names = {"pixels": "pixels", "samples": "samples", "cells": "cells", "path_length": "path length"}
    return [Row(f"time grows as {name} to the power", f"{found[key]:.2f}") for key, name in names.items()]
