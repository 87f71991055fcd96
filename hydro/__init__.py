"""Flow on moving blocks: one step, from reconstruction to the update, and the run of steps.

The folder's own files tell the story: `block`, `step`, `clock`, `ledger`, `history`,
`simulation`, and `rows`, which names what arrays hold.  Rooms, each
importing only those to its left:

    formulas, eos <- interior, perimeter <- block <- boundary <- sliding <- links <- motion, sources
    <- step <- history <- simulation

Below all stands `regrid`; `convection` is a house of its own.
"""
