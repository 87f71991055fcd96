"""Body sources: gravity, heating, programmed burn.

May import: `regrid`, `hydro.eos`, `hydro.block`, `hydro.ranks`.
"""
