"""Natural convection and moving fronts: problems, pictures, reports.

May import: the contract of `problems`, `problems.references`, `hydro.convection`.
"""
