"""Row kernels of a block's inside, one numerical phase a file; `advance` puts them in order.

May import: `regrid`, `hydro.rows`, `hydro.formulas`, `hydro.eos`.
"""
