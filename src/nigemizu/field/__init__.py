"""The refractive-index field on the compute device: value and gradient at any point."""

from nigemizu.field.analytic import (
    ExponentialSquare,
    ExponentialTemperature,
    Fisheye,
    GaussianBlob,
    LinearSquare,
    Luneburg,
    ParabolicGrin,
    Uniform,
)
from nigemizu.field.base import BoxedField, Field, UnboundedField
from nigemizu.field.layers import Layers
from nigemizu.field.placed import Placed
from nigemizu.field.types import Types, types
from nigemizu.field.volume import TrilinearVolume

__all__ = [
    "BoxedField",
    "ExponentialSquare",
    "ExponentialTemperature",
    "Field",
    "Fisheye",
    "GaussianBlob",
    "Layers",
    "LinearSquare",
    "Luneburg",
    "ParabolicGrin",
    "Placed",
    "TrilinearVolume",
    "Types",
    "UnboundedField",
    "Uniform",
    "types",
]
