"""Natural convection (Boussinesq); it shares nothing with the shock flow.

`tensor_grids` serves all: boxes in two dimensions (`box`, `equations`, `march`, `steady`,
`measure`), and `columns` of cells in one dimension.  May import: `regrid`.
"""
