"""Timing: the contestants take turns within one run, so that a load that comes and goes spares the ratios."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Mapping

from nigemizu.progress import SILENT, ProgressMeter

__all__ = ["OFTEN", "SELDOM", "alternate", "exponent"]

OFTEN = 3
"""Rounds of which the median counts."""
SELDOM = 2
"""The same for what takes seconds."""


def alternate(
    works: Mapping[str, Callable[[], object]],
    repeats: int = OFTEN,
    *,
    label: str = "timing",
    progress: ProgressMeter = SILENT,
) -> dict[str, float]:
    """Time pieces of work in turns.

    Parameters
    ----------
    works : mapping of str to callable
        Each returns when its work is done.
    repeats : int
        Rounds that count. The one before them, which compiles and fills the caches, does not.
    label : str
        What the meter calls it.
    progress : ProgressMeter
        Advances with each piece of work.

    Returns
    -------
    dict of str to float, s
        Median over the rounds.
    """
    taken: dict[str, list[float]] = {name: [] for name in works}
    progress.start(label, (repeats + 1) * len(works))
    for turn in range(repeats + 1):
        for name, work in works.items():
            began = time.perf_counter()
            work()
            if turn > 0:
                taken[name].append(time.perf_counter() - began)
            progress.advance()
    progress.finish()
    return {name: statistics.median(times) for name, times in taken.items()}


def exponent(small: float, large: float, factor: float) -> float:
    """p of a cost that grows as size to the power p, from its value at two sizes with this ratio.

    Examples
    --------
    >>> exponent(1.0, 8.0, 2.0)
    3.0
    """
    return math.log(large / small) / math.log(factor)
