"""Air that moves by itself: convection after Boussinesq on the mesh of the heat stage.

The modules, in the order in which a step uses them: `settings` (what a person chooses), `ground` (what
passes through the lower face), `padding`, `momentum`, `kernels` and `softening` (the compiled loops),
`pressure` (incompressibility), `cells` (what a device must be able to do) and `loops` (how the processor does
it; a graphics card in `device`), `moving` (the state and one step), `running` (from instant to instant),
`checkpoint`.
"""
