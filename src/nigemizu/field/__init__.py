"""The refractive-index field on the compute device: value and gradient at any point."""

from nigemizu.field.base import BoxedField, Field, UnboundedField
from nigemizu.field.types import Types, types
from nigemizu.field.volume import TrilinearVolume

__all__ = ["BoxedField", "Field", "TrilinearVolume", "Types", "UnboundedField", "types"]
