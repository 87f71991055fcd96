"""Nodes of a nearly valid grid moved one at a time, until every corner has area again.

May import `regrid.jit` and `regrid.measure`.
"""
