"""`shockgrid verify`: the standard problems at stated sizes, with their bars.

May import: all other rooms of `runs` but `runs.cli` and `runs.grids`, and all below them.
"""
