"""Conservative remapping of the state of a block from one grid to another (theory F12).

May import: `regrid` and all other subpackages of `hydro`.
"""
