"""From one grid to another: what a block holds laid on other cells, conservatively (theory F12).

May import: `regrid` and all other rooms of `hydro`.
"""
