"""Graphite in a conical target: deck <- layout, ripple, growth, peaks <- report <- problem.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
