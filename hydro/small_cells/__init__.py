"""The few cells that would hold back the time step of all others: found, and kept stable.

May import: `hydro.formulas`, `hydro.eos`, `hydro.rows` and `regrid`.
"""
