"""`shockgrid grid`: grids without flow, made, marched, judged and compared.

May import: `runs.deck`, `runs.store`, `runs.inspection`, `runs.pictures` and all below them.
"""
