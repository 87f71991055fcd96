"""Weight times size constant: on curves and surfaces, in areas and volumes.

May import: the contract of `regrid`, `regrid.measure`, `regrid.curves`, `regrid.algebraic`,
`regrid.barrier` and `regrid.hexahedra`.
"""
