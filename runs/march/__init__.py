"""Running: launch, march with progress and dumps, summary.

May import: `runs.deck`, `runs.ranks`, `runs.store`, `runs.gauges`, `runs.inspection`,
`runs.early_end`, `runs.forecast` and all below them.
"""
