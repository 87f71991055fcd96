"""Running: launch, march with progress and dumps, closing screen.

May import: `runs.deck`, `runs.store`, `runs.gauges`, `runs.inspection` and all below them.
"""
