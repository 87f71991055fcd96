"""Grids in which weight times size is constant: curves, surfaces, areas and volumes.

May import: the interfaces of `regrid`, `regrid.measure`, `regrid.curves`, `regrid.algebraic`,
`regrid.barrier` and `regrid.hexahedra`.
"""
