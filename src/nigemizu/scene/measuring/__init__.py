"""Tables and curves for those who measure: refraction, the horizon, and what is seen of distant objects."""

from __future__ import annotations

from nigemizu.scene.measuring.curve import TransferCurve
from nigemizu.scene.measuring.folds import Fold, ImageBand
from nigemizu.scene.measuring.refraction import RefractionTable, refraction_table
from nigemizu.scene.measuring.sea_horizon import HorizonTable, horizon_table
from nigemizu.scene.measuring.transfer import transfer_curve

__all__ = [
    "Fold",
    "HorizonTable",
    "ImageBand",
    "RefractionTable",
    "TransferCurve",
    "horizon_table",
    "refraction_table",
    "transfer_curve",
]
