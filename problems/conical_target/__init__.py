"""Graphite in a conical target: layout <- report <- pictures <- problem.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
