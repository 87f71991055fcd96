"""Natural convection (Boussinesq); it shares nothing with the shock flow.

`tensor_grids` serves all rooms: `box` (two-dimensional), `slot` (between vertical plates), `front`
(a moving front in one dimension, which uses `slot`).  May import: `regrid`.
"""
