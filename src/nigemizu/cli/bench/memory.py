"""Peak memory of a process that renders a picture, in units of its volume of air."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from nigemizu.errors import MachineError
from nigemizu.progress import SILENT, ProgressMeter

if TYPE_CHECKING:
    from nigemizu.scene.running import AirVolume

__all__ = ["measure_memory", "render_and_tell", "synthetic_air"]

_SIZE: Final = {"camera.width": 64, "camera.height": 36, "camera.samples": 1}


def measure_memory(
    nodes: tuple[int, int, int] = (256, 192, 256), *, progress: ProgressMeter = SILENT
) -> dict[str, Any]:
    """Peak memory of two fresh processes, one of which renders through twice as much air.

    Parameters
    ----------
    nodes : (int, int, int)
        Number of nodes along x, y and z of the smaller volume, large against everything else.
    progress : ProgressMeter

    Returns
    -------
    dict
        ``peak_bytes`` of both; ``volumes``, by how many float64 volumes the peak grows per volume, and
        ``base_bytes``, what is left without any. The last two are None where the system does not count.
    """
    nx, ny, nz = nodes
    peaks: list[int | None] = []
    progress.start("memory", 2)
    for width in (ny, 2 * ny):
        peaks.append(_in_a_process((nx, width, nz)))
        progress.advance()
    progress.finish()
    volume = 8 * nx * ny * nz
    small, large = peaks
    if small is None or large is None:
        return {"volume_bytes": volume, "peak_bytes": None, "volumes": None, "base_bytes": None}
    return {
        "volume_bytes": volume,
        "peak_bytes": [small, large],
        "volumes": (large - small) / volume,
        "base_bytes": 2 * small - large,
    }


def _in_a_process(nodes: tuple[int, int, int]) -> int | None:
    """Peak of a process of its own, bytes; None where the system does not count."""
    code = f"from nigemizu.cli.bench.memory import render_and_tell; render_and_tell({nodes})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["killed, perhaps for want of memory"])[-1]
        raise MachineError(f"the process whose memory is measured failed: {last}")
    peak: int | None = json.loads(done.stdout)["peak_bytes"]
    return peak


def render_and_tell(nodes: tuple[int, int, int]) -> None:
    """Render a small picture through air on so many nodes, and print the peak memory [bytes] as JSON."""
    from nigemizu.scene import Scene
    from nigemizu.scene.rendering import Studio

    studio = Studio(Scene.load("pyramid", _SIZE), "llvm")
    studio.shoot(synthetic_air(nodes))
    print(json.dumps({"peak_bytes": _peak()}))


def synthetic_air(nodes: tuple[int, int, int]) -> AirVolume:
    """Uneven air over a hot ground, made in place: making it needs no memory besides its own."""
    from nigemizu.scene.running import AirVolume

    nx, ny, nz = nodes
    z = np.linspace(0.0, 3.0, nz)
    refractivity = np.empty((nz, ny, nx))
    np.random.default_rng(0).standard_normal(out=refractivity)
    refractivity *= 1e-8
    refractivity += (2.64e-4 - 3e-5 * np.exp(-z / 0.2))[:, None, None]
    return AirVolume(np.linspace(-20.0, 2500.0, nx), np.linspace(-24.0, 24.0, ny), z, refractivity)


def _peak() -> int | None:
    """Peak memory of this process, bytes; None where the system does not count."""
    status = Path("/proc/self/status")
    if status.exists():
        # Not ru_maxrss: on Linux a child inherits in it the peak of the process that started it.
        found = re.search(r"^VmHWM:\s*(\d+) kB$", status.read_text(encoding="ascii"), re.MULTILINE)
        return None if found is None else int(found[1]) * 1024
    if sys.platform == "win32":
        return None
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
