"""The three ways in which work ends early, and what the command line makes of each."""


class BadInput(Exception):
    """A deck, file, grid or flag that cannot be used.

    The message says what, where and what would be right.  The command line prints it and exits
    with code 2.
    """


class RunFailure(Exception):
    """The physics of a run failed; the message names block, cell and time.

    The command line prints the message with the last restart point and exits with code 3.
    """


class RegridFailure(RunFailure):
    """No valid grid exists or was found for a boundary; names the side and its nodes.

    `nodes` (2, ni+1, nj+1), where a grid was made, is that one with its bad cells: for pictures.
    """

    def __init__(self, message: str, nodes=None):
        super().__init__(message)
        self.nodes = nodes
