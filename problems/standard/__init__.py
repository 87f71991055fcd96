"""Standard test problems with exact references, one file each.

May import: the contract of `problems`, `initial_states`, `references`.
"""
