"""A plate on a wedge: deck, plateau <- set_up <- run, report <- pictures <- problem <- polars.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
