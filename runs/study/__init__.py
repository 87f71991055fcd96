"""`shockgrid study`: one deck at many points, each an ordinary run; table, orders, picture.

May import: all other rooms of `runs` but `runs.cli` and `runs.grids`, and all below them.
"""
