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
from nigemizu.field.bottomless import Bottomless
from nigemizu.field.cell import Cell
from nigemizu.field.layers import Layers
from nigemizu.field.placed import Placed
from nigemizu.field.stratified import StratifiedVolume
from nigemizu.field.tricubic import TricubicVolume
from nigemizu.field.types import Types, types
from nigemizu.field.volume import TrilinearVolume

__all__ = [
    "Bottomless",
    "BoxedField",
    "Cell",
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
    "StratifiedVolume",
    "TricubicVolume",
    "TrilinearVolume",
    "Types",
    "UnboundedField",
    "Uniform",
    "types",
]
