"""Why runs end early: causes, what has helped, and what such a run leaves in its directory.

May import: `runs.deck`, `runs.store`, `runs.inspection`, `runs.pictures` and all below them.
"""
