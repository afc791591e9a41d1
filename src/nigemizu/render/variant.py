"""Choice of the Mitsuba variant, and registration of the plug-ins under it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, Literal

import drjit as dr
import mitsuba as mi

from nigemizu import field
from nigemizu.errors import InputError, MachineError

if TYPE_CHECKING:
    from nigemizu.render.media import AirResolver

__all__ = ["BACKENDS", "current_backend", "register", "select_variant"]

BACKENDS: Final = ("auto", "llvm", "cuda")
_VARIANTS: Final = {"llvm": "llvm_ad_rgb", "cuda": "cuda_ad_rgb"}


def select_variant(backend: Literal["auto", "llvm", "cuda"] = "auto") -> str:
    """Make Mitsuba ready on a backend, once per process, and register nigemizu's plug-ins.

    Parameters
    ----------
    backend : {"auto", "llvm", "cuda"}
        ``auto`` takes the variant that is set already, else CUDA where it is usable, else LLVM.

    Returns
    -------
    str
        The Mitsuba variant, ``llvm_ad_rgb`` or ``cuda_ad_rgb``.

    Raises
    ------
    MachineError
        If the backend is not usable here, LLVM is missing or older than 16, or another variant is in use
        in this process.

    Notes
    -----
    A Mitsuba variant is global to the process, and classes defined under one do not work under another:
    work on two backends takes two processes.
    """

    if backend not in BACKENDS:
        raise InputError("unknown backend", key="backend", value=backend, expected=", ".join(BACKENDS))
    current = mi.variant()
    if backend == "auto":
        wanted = current if current is not None else _VARIANTS["cuda" if _cuda_usable() else "llvm"]
    else:
        wanted = _VARIANTS[backend]
    if current is not None and current != wanted:
        raise MachineError(
            f"the Mitsuba variant {current} is already in use in this process, so {wanted} cannot be; "
            "use one backend per process"
        )
    if wanted not in _VARIANTS.values():
        raise MachineError(
            f"the Mitsuba variant {wanted} is set, and nigemizu renders under "
            f"{' and '.join(_VARIANTS.values())} only"
        )
    # Dr.Jit aborts the process inside an old LLVM, which Python cannot catch: look before compiling, also
    # under a variant that the caller has set.
    field.types("cuda" if wanted == _VARIANTS["cuda"] else "llvm")
    if current is None:
        mi.set_variant(wanted)
        # What a person must know comes as an error or warning of ours; Mitsuba would write to stdout.
        mi.set_log_level(mi.LogLevel.Error)
    _register_textures(wanted)
    return wanted


def register(resolve_air: AirResolver | None = None) -> None:
    """Register the integrator ``nigemizu`` with Mitsuba, under the variant in use (LLVM or CUDA if none).

    Afterwards a Mitsuba dictionary or XML scene renders through air by naming the integrator ``nigemizu``
    and its `air`. Calling this again is harmless; the last `resolve_air` counts.

    Parameters
    ----------
    resolve_air : callable, optional
        Turns a name that is no dataset (a scene's name or file) and a time [s] into refractivity on
        axes, ``(name, time) -> (x, y, z, refractivity)`` with ``refractivity[z, y, x]``.
    """

    from nigemizu.render.path_tracer import integrator_class

    variant = select_variant("auto")
    make: Callable[[Any], Any] = functools.partial(integrator_class(variant), resolve_air=resolve_air)
    mi.register_integrator("nigemizu", make)


def current_backend() -> Literal["llvm", "cuda"]:
    """``"llvm"`` or ``"cuda"``: the backend of the variant in use."""

    return "cuda" if mi.variant() == _VARIANTS["cuda"] else "llvm"


@functools.cache
def _register_textures(variant: str) -> None:

    from nigemizu.render.textures import texture_classes

    for name, cls in texture_classes(variant).items():
        mi.register_texture(name, cls)


def _cuda_usable() -> bool:
    return bool(dr.has_backend(dr.JitBackend.CUDA))
