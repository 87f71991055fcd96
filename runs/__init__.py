"""People and files: command line, decks, run directories, HDF5 store, inspection, pictures."""
