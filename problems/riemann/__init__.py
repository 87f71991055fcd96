"""Riemann problems: the cases, the problem, its report.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
