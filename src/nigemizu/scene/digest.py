"""What air a film was made of, as a number that changes when its contents do."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np

from nigemizu.scene.running import AirSource, AirVolume

__all__ = ["air_digest"]


def air_digest(air: AirSource) -> str | None:
    """SHA-256 of the air that was given, or None when there is none.

    Notes
    -----
    Of a dataset on disk: of the names, sizes and bytes of its files, metadata and data alike, wherever it
    lies, and of the box that is cut out of it. Of air in memory: of the names and values of its arrays.
    Limits: equal numbers that are stored otherwise (compressed, cut into other chunks) count as other air.
    """
    from nigemizu.heat.reading.crop import split_crop

    if air is None:
        return None
    total = hashlib.sha256()
    if isinstance(air, str | os.PathLike):
        place, crop = split_crop(os.fspath(air))
        root = Path(place).expanduser()
        for path, name in _files(root):
            with path.open("rb") as file:
                content = hashlib.file_digest(file, "sha256").hexdigest()
            total.update(f"{name} {path.stat().st_size} {content}\n".encode())
        if crop:
            total.update(repr(sorted(crop.items())).encode())
        return f"sha256:{total.hexdigest()}"
    arrays = air._asdict() if isinstance(air, AirVolume) else air.variables
    for name in sorted(map(str, arrays)):
        values = np.ascontiguousarray(arrays[name])
        total.update(f"{name} {values.dtype.str} {values.shape}\n".encode())
        total.update(values.tobytes())
    return f"sha256:{total.hexdigest()}"


def _files(root: Path) -> list[tuple[Path, str]]:
    """The files of a dataset, and their names: of a file, a folder, or what a pattern matches."""
    if root.is_dir():
        return [
            (path, path.relative_to(root).as_posix()) for path in sorted(root.rglob("*")) if path.is_file()
        ]
    if root.exists() or not any(mark in root.name for mark in "*?["):
        return [(root, root.relative_to(root).as_posix())]
    return [(path, path.name) for path in sorted(root.parent.glob(root.name))]
