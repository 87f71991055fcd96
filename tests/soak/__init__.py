"""Endurance: commands killed, starved, fed with damaged files and odd decks, for as long as asked.

`python tests/soak` says how.  Each kind of trial is a class of its own file; a trial is
told by its kind, the seed and its number alone.  May import everything of the packages.
"""
