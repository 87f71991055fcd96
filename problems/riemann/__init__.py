"""Riemann problems: the cases, the problem, its report.

May import: the contract of `problems`, `initial_states`, `references`.
"""
