"""A plate on a wedge: set_up <- report <- run, pictures <- problem.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
