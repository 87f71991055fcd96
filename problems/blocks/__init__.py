"""Blocks of a deck's own: grids from files or curves, materials, states, sides and links by name.

May import: the contract of `problems`, `problems.initial_states`, `problems.references`.
"""
