"""What people run: one room, or one file, a problem.

The folder's own files are the contract: decks, `Problem`, `Evolution`, the registry.  Rooms:

    deck, evolution <- problem <- registry, grid_march
    <- references <- initial_states <- one file or one room a problem

A problem imports the contract, `initial_states` and `references`, and no other problem.
"""
