"""Exact and independent solutions by which problems are judged.

May import: `regrid`, `hydro.eos`, `hydro.formulas`, `hydro.strength.laws`; no problem.
"""
