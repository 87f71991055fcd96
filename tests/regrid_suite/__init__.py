"""A benchmark suite for regridding behind moving boundaries: named marches, measures, peers.

`python tests/regrid_suite` says how.  The marches are files of nodes and need none of this
code to be read (README.md); a regridder is any callable `regrid(previous, boundary) -> nodes`.
May import `regrid` and the pictures of `runs.grids`.
"""
