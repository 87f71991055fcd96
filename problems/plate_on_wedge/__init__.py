"""A plate is thrown onto a wedge: deck <- set_up <- run, report <- problem.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
