"""The command line: one function per command, which imports heavy packages itself.

May import: everything.
"""
