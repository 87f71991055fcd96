"""Gauges: the flow at fixed points and at points of the material, after every step.

May import: `runs.store` and all below it.
"""
