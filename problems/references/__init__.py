"""Exact and independent solutions by which problems are judged.

May import: `regrid`, `hydro.eos`, `hydro.formulas`; no problem.
"""
