"""Backends and the check of LLVM."""

from __future__ import annotations

import drjit as dr
import pytest

from nigemizu import field
from nigemizu.errors import InputError, MachineError


def test_types_of_mitsubas_variant() -> None:
    import drjit.llvm.ad as ad

    types = field.types("llvm", "single", differentiable=True)
    assert types.Float is ad.Float
    assert types.Array3f is ad.Array3f


def test_double_precision_keeps_single_storage_at_hand() -> None:
    types = field.types("llvm", "double")
    assert dr.type_v(types.Float) == dr.VarType.Float64
    assert dr.value_t(types.Array3f) is types.Float
    assert types.storage("single") is types.Float32
    assert types.storage("double") is types.Float


@pytest.mark.parametrize("version", [(15, 0, 7), (11, 1, 0)])
def test_old_llvm_is_refused_before_it_can_abort(version: tuple[int, int, int]) -> None:
    with pytest.raises(MachineError, match=r"too old.*apt install libllvm19.*DRJIT_LIBLLVM_PATH") as caught:
        field.types("llvm", llvm_version=lambda: version)
    assert "\n" not in str(caught.value)


def test_missing_llvm_is_named() -> None:
    with pytest.raises(MachineError, match=r"not found.*apt install libllvm19"):
        field.types("llvm", llvm_version=lambda: None)


def test_oldest_good_llvm_is_accepted() -> None:
    assert field.types("llvm", llvm_version=lambda: (16, 0, 0)).backend == "llvm"


@pytest.mark.parametrize(("backend", "precision"), [("metal", "single"), ("llvm", "half")])
def test_unknown_names_are_refused(backend: str, precision: str) -> None:
    with pytest.raises(InputError, match="expected"):
        field.types(backend, precision)  # type: ignore[arg-type]
