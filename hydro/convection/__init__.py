"""Natural convection (Boussinesq), independent of the shock flow.

All solvers use `tensor_grids`: those for boxes in two dimensions (`box`, `equations`, `march`,
`steady`, `measure`), and `columns` of cells in one dimension.  May import: `regrid`.
"""
