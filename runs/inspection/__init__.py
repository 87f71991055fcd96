"""Words about runs: listing, info, account, comparison, units.

May import: `runs.deck`, `runs.store` and all below them.
"""
