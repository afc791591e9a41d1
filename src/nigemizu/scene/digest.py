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
    lies. Of air in memory: of the names and values of its arrays. Limits: equal numbers that are stored
    otherwise (compressed, cut into other chunks) count as other air.
    """
    if air is None:
        return None
    total = hashlib.sha256()
    if isinstance(air, str | os.PathLike):
        root = Path(air).expanduser()
        files = sorted(path for path in root.rglob("*") if path.is_file()) if root.is_dir() else [root]
        for path in files:
            with path.open("rb") as file:
                content = hashlib.file_digest(file, "sha256").hexdigest()
            name = path.relative_to(root).as_posix()
            total.update(f"{name} {path.stat().st_size} {content}\n".encode())
        return f"sha256:{total.hexdigest()}"
    arrays = air._asdict() if isinstance(air, AirVolume) else air.variables
    for name in sorted(map(str, arrays)):
        values = np.ascontiguousarray(arrays[name])
        total.update(f"{name} {values.dtype.str} {values.shape}\n".encode())
        total.update(values.tobytes())
    return f"sha256:{total.hexdigest()}"
