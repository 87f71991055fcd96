"""What a run costs: before it, while it runs, and why its steps become short.

May import: `runs.deck`, `runs.store`, `runs.inspection` and all below them.
"""
