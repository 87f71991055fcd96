"""A shock hits a perturbed interface: the problem and its report.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
