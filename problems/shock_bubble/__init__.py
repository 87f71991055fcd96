"""A shock and a bubble: the problem, its report, an independent fixed-grid solver.

May import: the contract of `problems`, `initial_states`, `references`.
"""
