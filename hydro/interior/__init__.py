"""Row kernels of a block's inside and sides, one numerical phase a file; `advance` orders them.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.formulas`, `hydro.eos`.
"""
