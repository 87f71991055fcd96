"""Flow on moving blocks: one step, from reconstruction to the update, and the run of steps.

The folder's own files tell the story: `block`, `step`, `simulation`, `ledger`.  Rooms, each
importing only those to its left:

    formulas, eos <- interior, perimeter <- block <- boundary <- sliding <- links <- motion, sources
    <- step <- simulation

Below all stands `regrid`; `convection` is a house of its own.
"""
