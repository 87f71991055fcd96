"""Codes of others whose grids `regrid` moves or smooths; each module is run by itself."""
