"""What this machine can run, and the one line to type when it cannot.

Looking must be safe: with an LLVM older than 16 the compiler aborts the whole process on some processors, so
its version is asked for and nothing is compiled.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import sys
from typing import Any

__all__ = ["examine", "report"]

OLDEST_LLVM = 16
_PACKAGES = ("mitsuba", "drjit", "numpy", "scipy", "numba", "xarray", "zarr", "netCDF4", "pydantic", "av", "matplotlib")


def examine() -> dict[str, Any]:
    """Find out what is installed.

    Returns
    -------
    dict
        JSON-ready; ``can_render`` says whether pictures can be made here, ``remedy`` what to do if not.
    """
    from nigemizu.scene.memory import memory_available

    version, cuda = _llvm_version(), _cuda()
    state = "missing" if version is None else "too old" if version[0] < OLDEST_LLVM else "found"
    can_render = state == "found" or cuda
    return {
        "nigemizu": importlib.metadata.version("nigemizu"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": {name: importlib.metadata.version(name) for name in _PACKAGES},
        "llvm": {
            "state": state,
            "version": None if version is None else ".".join(map(str, version)),
            "needed": f">= {OLDEST_LLVM}",
            "library": os.environ.get("DRJIT_LIBLLVM_PATH"),
        },
        "cuda": cuda,
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_available": memory_available(),
        "disk_free": shutil.disk_usage(os.getcwd()).free,
        "can_render": can_render,
        "remedy": None if state == "found" else _remedy(state),
    }


def report(found: dict[str, Any]) -> str:
    """The findings as lines to read, and to paste into a bug report."""
    llvm = found["llvm"]
    rows = [
        ("nigemizu", found["nigemizu"]),
        ("Python", f"{found['python']} on {found['platform']}"),
        ("packages", ", ".join(f"{name} {version}" for name, version in found["packages"].items())),
        ("LLVM", f"{llvm['state']} {llvm['version'] or ''} (needed {llvm['needed']})".replace("  ", " ")),
        ("CUDA", "usable" if found["cuda"] else "no usable device"),
        ("cores", str(found["cores"])),
        ("memory", _gigabytes(found["memory_available"]) + " available"),
        ("disk", _gigabytes(found["disk_free"]) + " free here"),
        ("pictures", "can be rendered" if found["can_render"] else "cannot be rendered"),
    ]
    if found["remedy"]:
        rows.append(("remedy", found["remedy"]))
    return "\n".join(f"{name:9} {text}" for name, text in rows)


def _llvm_version() -> tuple[int, ...] | None:
    import drjit

    if not drjit.has_backend(drjit.JitBackend.LLVM):
        return None
    version = drjit.detail.llvm_version()
    return tuple(int(part) for part in str(version).strip("()").replace(",", ".").split(".") if part.strip())


def _cuda() -> bool:
    import drjit

    return bool(drjit.has_backend(drjit.JitBackend.CUDA))


def _remedy(state: str) -> str:
    if sys.platform == "darwin":
        return "brew install llvm"
    if shutil.which("apt-get"):
        return "sudo apt-get install libllvm19"
    if shutil.which("dnf"):
        return "sudo dnf install llvm-libs"
    verb = "install" if state == "missing" else "update"
    return f"{verb} LLVM {OLDEST_LLVM} or newer and set DRJIT_LIBLLVM_PATH to its shared library"


def _gigabytes(amount: int | None) -> str:
    return "unknown" if amount is None else f"{amount / 1e9:.1f} GB"
