"""Descriptions of runs: listing, info, account, comparison.

May import: `runs.deck`, `runs.store` and all below them.
"""
