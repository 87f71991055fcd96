"""`shockgrid bench`: how fast this machine computes, and where the time of a step goes.

May import: all other rooms of `runs` but `runs.cli` and `runs.grids`, and all below them.
"""
