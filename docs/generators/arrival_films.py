"""Films through turbulence of known strength, measured with ``nigemizu measure``: the data of a page.

    make validation

renders what is not in ``out/arrival`` yet, a quarter of an hour on two idle cores, and writes
``docs/data/arrival/measured.json`` and a picture, from which the page is made at each build.
"""

from __future__ import annotations

import json
import shlex
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from generators.arrival_straight import Sights
from nigemizu.cli import main as nigemizu
from nigemizu.measure import Measurement, measure_film
from nigemizu.measure.saving import save
from nigemizu.progress import SILENT
from nigemizu.scene import Scene
from nigemizu.scene.running import air_instants

__all__ = ["APERTURES", "DATA", "SCENE", "STRENGTHS"]

DOCS = Path(__file__).resolve().parents[1]
SCENE = DOCS / "data" / "arrival" / "scene.toml"
DATA = SCENE.with_name("measured.json")
FILMS = DOCS.parent / "out" / "arrival"

STRENGTHS = (1e-15, 1e-14, 1e-13)
"""Cn² of the films [m^(−2/3)]."""

APERTURES = {25.0: 0.04, 8.0: 0.125}
"""f-numbers of the lens of 1 m, and what diameters [m] they are."""

SIGNIFICANT = 6
ENLARGED = 2


def main() -> None:
    FILMS.mkdir(parents=True, exist_ok=True)
    films = []
    for seed, (f_number, cn2) in enumerate(((f, c) for f in APERTURES for c in STRENGTHS), start=1):
        film = FILMS / f"{1e3 * APERTURES[f_number]:.0f}mm_{cn2:.0e}.mp4"
        changes = {
            "camera.f_number": f_number, "camera.seed": seed, "turbulence.cn2": cn2, "turbulence.seed": seed,
        }  # fmt: skip
        flags = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
        words = ["animate", str(SCENE), *flags, "-o", str(film)]
        print("nigemizu", shlex.join(words), file=sys.stderr)
        if code := nigemizu(words):
            raise SystemExit(code)
        measured = measure_film(film.with_name(f"{film.stem}_frames"))
        print(measured.table(), file=sys.stderr)
        save(measured, film.with_suffix(".png"))
        found = _kept(measured) | {"straight": _straight(Scene.load(SCENE, changes), measured)}
        films.append({"cn2": cn2, "aperture": APERTURES[f_number], "seed": seed} | found)
    data = {"version": version("nigemizu"), "films": films}
    DATA.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    _picture(DOCS / "images" / "arrival.webp")


def _kept(measured: Measurement) -> dict[str, Any]:
    """What the page shows."""
    quantities = {
        one.name: [_short(value) for value in (one.value, one.low, one.high, one.theory)]
        for one in measured.quantities
        if one.theory is not None
    }
    apart, seen = measured.separations, measured.tiles.radius[np.isfinite(measured.tiles.radius)]
    return {
        "frames": measured.frames,
        "tiles": int(seen.size),
        "tile": measured.tile,
        "radius": _short(float(np.median(seen))),
        "pixel_angle": _short(measured.optics.pixel_angle),
        "independent": _short(measured.independent),
        "noise_share": _short(measured.noise_share),
        "quantities": quantities,
        "separation": [_short(one) for one in apart.angle],
        "along": [_short(one) for one in apart.along],
        "across": [_short(one) for one in apart.across],
    }


def _straight(scene: Scene, measured: Measurement) -> dict[str, float | None]:
    """What the film ought to give, from straight rays through the same air."""
    camera, tiles = scene.camera, measured.tiles
    places = tiles.place[np.isfinite(tiles.radius), 0] - (camera.width - 1) / 2
    side = measured.tile * camera.pixel_angle
    sights = Sights(-camera.pixel_angle * places, side, camera.eye[2], camera.focus, camera.aperture_diameter)
    angles = np.array([sights.angles(air) for air in air_instants(scene, scene.film.times, None, SILENT)])
    variance = np.var(angles, axis=0, ddof=1).mean()
    # mean over all pairs of tiles, from what is left without their common motion
    apart = np.var(angles - angles.mean(axis=1, keepdims=True), axis=0, ddof=1).sum(axis=0)
    difference = 2 * float(apart.mean()) / (places.size - 1)
    return {"variance": _short(float(variance)), "difference": _short(difference)}


def _short(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(f"{value:.{SIGNIFICANT}g}")


def _picture(path: Path) -> None:
    """One frame of each strength through the smaller aperture, one above the other."""
    frames = [FILMS / f"40mm_{cn2:.0e}_frames" / "0000.png" for cn2 in STRENGTHS]
    pixels = np.concatenate(
        [np.pad(np.asarray(Image.open(f).convert("L")), ((0, 2), (0, 0))) for f in frames]
    )
    sheet = Image.fromarray(pixels)
    size = (ENLARGED * sheet.width, ENLARGED * sheet.height)
    sheet.resize(size, Image.Resampling.LANCZOS).save(path, quality=90, method=6)


if __name__ == "__main__":
    main()
