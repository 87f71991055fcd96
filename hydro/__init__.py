"""Flow on moving blocks: the time step, from reconstruction to update, and the march in time.

The main files are in the folder itself: `block`, `step`, `clock`, `ledger`, `history`,
`simulation`, `workers`, `sources`, and `rows`, which names the rows of arrays.  Each subpackage or
file imports only those to its left:

    formulas, eos <- interior, perimeter <- block <- ranks <- boundary, crowding, redistribution
    <- small_cells <- facets, sliding <- links <- motion, sources <- step <- history <- simulation

All of them may import `regrid`; `convection` is independent of the others.
"""
