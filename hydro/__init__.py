"""Flow on moving blocks: one step, from reconstruction to the update, and the run of steps.

The folder's own files tell the story: `block`, `step`, `clock`, `ledger`, `history`, `simulation`,
`workers`, `sources`, and `rows`, which names what arrays hold.  Rooms and files, each importing
only those to its left:

    formulas, eos <- interior, perimeter <- block <- ranks <- boundary, small_cells <- sliding
    <- links <- motion, sources <- step <- history <- simulation

Below all stands `regrid`; `convection` is a house of its own.
"""
