"""Array types of a compute backend, and the check that the backend can be used at all."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any, Final, Literal, TypeAlias, final

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike, NDArray

from nigemizu.errors import InputError, MachineError

__all__ = ["Backend", "Precision", "Types", "aligned_zeros", "types"]

Backend: TypeAlias = Literal["llvm", "cuda"]
Precision: TypeAlias = Literal["single", "double"]

OLDEST_LLVM: Final = 16  # older ones abort the whole process on machines with AVX-512

ALIGNMENT: Final = 64  # bytes

_LLVM_REMEDY: Final = "install it (Debian, Ubuntu: apt install libllvm19) or name it in DRJIT_LIBLLVM_PATH"


@final
class Types:
    """The Dr.Jit array types of one backend and precision. Made by `types`; frozen.

    Attributes
    ----------
    backend : {"llvm", "cuda"}
    precision : {"single", "double"}
        Precision of positions, directions and everything computed from them.
    differentiable : bool
        Whether the types can carry derivatives (Mitsuba's ``*_ad_*`` variants use such types).
    Float, UInt32, Int32, Bool, Array3f, Array4f : type
        Arrays over the rays; ``Array3f`` holds three ``Float``, ``Array4f`` four.
    Float32, Float64 : type
        Single and double arrays whatever the precision, for stored data.
    Pair32, Pair64 : type
        Two of either, for stored records.
    """

    # Not a dataclass: Dr.Jit would take it for a part of the state of loops that mention it.

    def __init__(self, backend: Backend, precision: Precision, differentiable: bool) -> None:
        module = importlib.import_module(f"drjit.{backend}.ad" if differentiable else f"drjit.{backend}")
        single = precision == "single"
        self.backend: Final = backend
        self.precision: Final = precision
        self.differentiable: Final = differentiable
        self.Float: Final[Any] = module.Float if single else module.Float64
        self.UInt32: Final[Any] = module.UInt32
        self.Int32: Final[Any] = module.Int32
        self.Bool: Final[Any] = module.Bool
        self.Array3f: Final[Any] = module.Array3f if single else module.Array3f64
        self.Array4f: Final[Any] = module.Array4f if single else module.Array4f64
        self.Float32: Final[Any] = module.Float
        self.Float64: Final[Any] = module.Float64
        self.Pair32: Final[Any] = module.Array2f
        self.Pair64: Final[Any] = module.Array2f64

    def __repr__(self) -> str:
        return f"types({self.backend!r}, {self.precision!r}, differentiable={self.differentiable})"

    def table(self, values: ArrayLike) -> Any:
        """Device array (Float) of numbers that are looked up, of which rows of four can be read at once."""
        numbers = np.asarray(values, dtype=np.float32 if self.precision == "single" else np.float64).ravel()
        aligned = aligned_zeros(numbers.size, self.precision)
        aligned[:] = numbers
        return self.Float(aligned)

    def storage(self, precision: Precision) -> Any:
        """Array type that stores data in `precision`."""
        return self.Float32 if precision == "single" else self.Float64

    def pair(self, precision: Precision) -> Any:
        """Array type of two numbers that are stored side by side in `precision`."""
        return self.Pair32 if precision == "single" else self.Pair64


def aligned_zeros(size: int, precision: Precision) -> NDArray[Any]:
    """Zeros (size,) that begin where a device can read rows of them.

    The device may share the host's memory, and reads rows only if that is aligned: kernels would otherwise
    differ by where the memory happens to lie.
    """
    dtype = np.dtype(np.float32 if precision == "single" else np.float64)
    length = size * dtype.itemsize
    room: NDArray[Any] = np.zeros(length + ALIGNMENT, dtype=np.uint8)
    start = -room.ctypes.data % ALIGNMENT
    return room[start : start + length].view(dtype)


def types(
    backend: Backend = "llvm",
    precision: Precision = "single",
    differentiable: bool = False,
    *,
    llvm_version: Callable[[], tuple[int, ...] | None] | None = None,
) -> Types:
    """Array types of a backend.

    Parameters
    ----------
    backend : {"llvm", "cuda"}
        Processor (through LLVM) or NVIDIA graphics card.
    precision : {"single", "double"}
        Single for pictures, double for science.
    differentiable : bool
        Take the types that can carry derivatives. Mitsuba's ``llvm_ad_rgb`` works with
        ``types("llvm", "single", differentiable=True)``.
    llvm_version : callable, optional
        Source of the LLVM version (major, minor, patch), None where there is no LLVM;
        by default Dr.Jit is asked.

    Returns
    -------
    Types

    Raises
    ------
    MachineError
        When the backend is missing, or LLVM is older than 16.
    InputError
        When the backend or the precision has another name.
    """
    if backend not in ("llvm", "cuda"):
        raise InputError("no such backend", key="backend", value=backend, expected="llvm or cuda")
    if precision not in ("single", "double"):
        raise InputError("no such precision", key="precision", value=precision, expected="single or double")
    if backend == "llvm":
        _check_llvm(llvm_version or _dr_jit_llvm_version)
    elif not dr.has_backend(dr.JitBackend.CUDA):
        raise MachineError("no usable NVIDIA graphics card and driver; use the llvm backend")
    return Types(backend, precision, differentiable)


def _dr_jit_llvm_version() -> tuple[int, ...] | None:
    # has_backend only loads the library; nothing is compiled before the version has been checked.
    if not dr.has_backend(dr.JitBackend.LLVM):
        return None
    version: tuple[int, ...] = dr.detail.llvm_version()
    return version


def _check_llvm(llvm_version: Callable[[], tuple[int, ...] | None]) -> None:
    version = llvm_version()
    if version is None:
        raise MachineError(f"LLVM ≥ {OLDEST_LLVM} was not found; {_LLVM_REMEDY}")
    if version[0] < OLDEST_LLVM:
        found = ".".join(str(part) for part in version)
        raise MachineError(f"LLVM {found} is too old (≥ {OLDEST_LLVM} is needed); {_LLVM_REMEDY}")
