"""The benchmark table: how fast this machine heats air and bends light, in under two minutes.

Every contestant is timed in turns with what it is compared with, in the same run: compare the ratios, since a
second load on the machine halves every speed.
"""

from nigemizu.cli.bench.suite import BENCHMARKS, FULL, Sizes, run_all
from nigemizu.cli.bench.table import rows, table

__all__ = ["BENCHMARKS", "FULL", "Sizes", "rows", "run_all", "table"]
