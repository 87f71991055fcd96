"""Standard test problems with exact references, one file each.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
