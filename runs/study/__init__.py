"""`shockgrid study`: one deck at many points, each an ordinary run; table, orders, picture.

May import: all subpackages of `runs` except `runs.cli` and `runs.grids`, and all below them.
"""
