"""Grids as geometry: nodes, boundary polylines, weights; no density, no equation of state.

The folder's own files are the contract: errors, compiling, reports, protocols, sides, names that
other packages bring, the registry
of regridders.
Rooms, each importing only those to its left:

    errors, jit, report, protocol, sides <- curves, measure <- algebraic
    <- barrier, domains, node_speeds <- equidistribution, given <- variational <- registry
"""
