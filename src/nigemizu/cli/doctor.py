"""What this machine can run, and the one line to type when it cannot.

Looking must be safe: with an LLVM older than 16 the compiler aborts the whole process on some processors, so
its version is asked for and nothing is compiled.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.metadata
import os
import platform
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from nigemizu.errors import MachineError
from nigemizu.memory import available_memory

__all__ = ["demand_backend", "examine", "find_backends", "import_compiler", "report"]

OLDEST_LLVM: Final = 16
OLDEST_DRIVER: Final = 535  # of NVIDIA
_PACKAGES: Final = (
    "mitsuba",
    "drjit",
    "numpy",
    "scipy",
    "numba",
    "xarray",
    "zarr",
    "netCDF4",
    "pydantic",
    "av",
    "matplotlib",
)


def examine() -> dict[str, Any]:
    """Find out what is installed.

    Returns
    -------
    dict
        JSON-ready; ``can_render`` says whether pictures can be made here, ``remedy`` what to do if not.
    """
    version, cuda = find_backends()
    state = _llvm_state(version)
    cuda_state = _cuda_state(cuda)
    can_render = state == "found" or cuda_state == "usable"
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
        "cuda": cuda_state == "usable",
        "cuda_state": cuda_state,
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_available": available_memory(),
        "disk_free": shutil.disk_usage(os.getcwd()).free,
        "can_render": can_render,
        "device": _device(state, cuda_state),
        "remedy": None if state == "found" else _remedy(state),
        "cuda_remedy": _CUDA_REMEDIES.get(cuda_state),
    }


def report(found: dict[str, Any]) -> str:
    """The findings as lines to read, and to paste into a bug report."""
    llvm = found["llvm"]
    rows = [
        ("nigemizu", found["nigemizu"]),
        ("Python", f"{found['python']} on {found['platform']}"),
        ("packages", ", ".join(f"{name} {version}" for name, version in found["packages"].items())),
        ("LLVM", f"{llvm['state']} {llvm['version'] or ''} (needed {llvm['needed']})".replace("  ", " ")),
        ("CUDA", found["cuda_state"]),
        ("cores", f"{found['cores']} of {found['processor']}"),
        ("memory", _gigabytes(found["memory_available"]) + " available"),
        ("disk", _gigabytes(found["disk_free"]) + " free here"),
        (
            "pictures",
            f"can be rendered, by {found['device']}" if found["can_render"] else "cannot be rendered",
        ),
    ]
    rows += [("remedy", found[key]) for key in ("remedy", "cuda_remedy") if found[key]]
    return "\n".join(f"{name:9} {text}" for name, text in rows)


def import_compiler() -> None:
    """Import Dr.Jit without its words about what this machine lacks.

    It writes them straight to the process's stderr, already while it is imported; nigemizu says the same in
    one line, and only where a compiler is needed.
    """
    with _hushed():
        importlib.import_module("drjit")


def find_backends() -> tuple[tuple[int, ...] | None, bool]:
    """Version of LLVM (None: missing) and whether CUDA is usable."""
    import_compiler()
    import drjit

    with _hushed():
        llvm, cuda = drjit.has_backend(drjit.JitBackend.LLVM), drjit.has_backend(drjit.JitBackend.CUDA)
    return (drjit.detail.llvm_version() if llvm else None), bool(cuda)


def demand_backend(variant: str) -> None:
    """Refuse to go on where nothing can compile the rays.

    Raises
    ------
    MachineError
        With what is missing and the line to type.
    """
    version, cuda = find_backends()
    if variant == "cuda" or (variant == "auto" and cuda):
        found = _cuda_state(cuda)
        if found == "usable":
            return
        remedy = f", or {_CUDA_REMEDIES[found]}" if found in _CUDA_REMEDIES else ""
        raise MachineError(f"CUDA cannot be used: {found}; use --variant llvm{remedy}")
    state = _llvm_state(version)
    if state == "missing":
        raise MachineError(f"LLVM {OLDEST_LLVM} or newer is needed and none was found; {_remedy(state)}")
    if version is not None and state == "too old":
        shown = ".".join(map(str, version))
        raise MachineError(f"LLVM {shown} is too old, {OLDEST_LLVM} or newer is needed; {_remedy(state)}")


_NO_OPTIX: Final = "no OptiX in the driver"
_OLD_DRIVER: Final = "the driver is too old or does not answer"
_CUDA_REMEDIES: Final = {
    _NO_OPTIX: "install the driver's OptiX library libnvoptix.so.1 (in a container: "
    "NVIDIA_DRIVER_CAPABILITIES=all)",
    _OLD_DRIVER: f"update the NVIDIA driver to {OLDEST_DRIVER} or newer; nvidia-smi must list the card",
}


def _cuda_state(usable: bool) -> str:
    """What CUDA can do for pictures: Mitsuba needs the driver's OptiX as well."""
    if usable:
        return "usable" if _has_optix() else _NO_OPTIX
    return _OLD_DRIVER if _has_card() else "no NVIDIA card"


def _has_optix() -> bool:
    if sys.platform != "linux":
        return True  # the driver brings it along
    try:
        ctypes.CDLL("libnvoptix.so.1")
    except OSError:
        return False
    return True


def _has_card() -> bool:
    return Path("/proc/driver/nvidia/version").exists() or Path("/dev/nvidiactl").exists()


def _device(llvm: str, cuda: str) -> str | None:
    """What pictures are rendered by, unless ``--variant`` says otherwise; None: nothing."""
    if cuda == "usable":
        return "CUDA and OptiX"
    if llvm != "found":
        return None
    return "LLVM, with --variant llvm" if cuda == _NO_OPTIX else "LLVM"


def _llvm_state(version: tuple[int, ...] | None) -> str:
    return "missing" if version is None else "too old" if version[0] < OLDEST_LLVM else "found"


@contextmanager
def _hushed() -> Iterator[None]:
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _remedy(state: str) -> str:
    if os.environ.get("DRJIT_LIBLLVM_PATH"):  # taken before any that is installed
        return "DRJIT_LIBLLVM_PATH names the wrong library; type: unset DRJIT_LIBLLVM_PATH"
    if sys.platform == "darwin":
        return "type: brew install llvm"
    if shutil.which("apt-get"):
        return "type: sudo apt-get install libllvm19"
    if shutil.which("dnf"):
        return "type: sudo dnf install llvm-libs"
    verb = "install" if state == "missing" else "update"
    return f"{verb} LLVM {OLDEST_LLVM} or newer and set DRJIT_LIBLLVM_PATH to its shared library"


def _processor() -> str:
    names = Path("/proc/cpuinfo")  # what Python itself calls the processor is only its family
    if names.exists():
        for line in names.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _gigabytes(amount: int | None) -> str:
    return "unknown" if amount is None else f"{amount / 1e9:.1f} GB"
