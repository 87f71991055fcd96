"""Decks: reading, checking, schema, and those that come with shockgrid (`packaged/`).

May import: `regrid`, `hydro`, `problems`.
"""
