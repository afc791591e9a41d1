"""The cells of moving air in a device's own memory: the same equations as array code, for a graphics card.

The modules, in the order in which a step uses them: `lattice` (where a cell and its neighbours stand),
`stencils` (what carries, shears and lifts), `columns` (implicit diffusion and the pressure, level by level),
`transforms` (waves along x and y), `cells` (the fields, and how a step puts these together).
"""

from nigemizu.heat.flow.device.cells import DeviceCells

__all__ = ["DeviceCells"]
