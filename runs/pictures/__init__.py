"""Pictures of a run: fields, history, interfaces.

May import: `runs.deck`, `runs.store`, `runs.inspection` and all below them.
"""
