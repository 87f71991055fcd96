"""Reports: one HTML file about a run, or all runs of a study, for somebody who was not there.

May import: everything in `runs` but `runs.cli`, and all below it.
"""
