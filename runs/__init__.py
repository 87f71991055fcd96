"""People and files: command line, decks, files of a run, inspection, pictures.

Rooms, each importing only those to its left:

    deck, engines <- store <- inspection <- march, pictures <- grids, verify <- study <- cli
"""
