"""Reports: one HTML file that tells a run, or all runs of a study, to somebody who was not there.

May import: everything in `runs` but `runs.cli`, and all below it.
"""
