"""Natural convection (Boussinesq); it shares nothing with the shock flow.

`tensor_grids` serves all: boxes in two dimensions (`box`, `equations`, `march`, `steady`,
`measure`), the `slot` between vertical plates, and `front`, a moving front in one dimension.  May
import: `regrid`.
"""
