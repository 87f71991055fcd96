"""Scalar formulas: geometry, reconstruction, Riemann solvers; no arrays, no rows.

May import: `regrid`.
"""
