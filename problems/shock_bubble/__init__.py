"""A shock and a bubble: the problem, its report, an independent fixed-grid solver.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
