"""The command line: one function a command; what is heavy is imported inside it.

May import: everything.
"""
