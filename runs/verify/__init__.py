"""`shockgrid verify`: the standard problems at stated sizes, with their bars.

May import: all rooms of `runs` but `cli` and `grids`.
"""
