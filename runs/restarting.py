"""Making the runner that goes on with the run in a directory."""

from __future__ import annotations

from regrid.errors import BadInput
from runs.deck_reading import read_toml, resolve_deck
from runs.directory import RunDirectory
from runs.runner import Runner

CHANGEABLE = ("run", "output", "regrid")


def make_runner(directory: RunDirectory, settings: tuple[str, ...], quiet: bool) -> Runner:
    """A runner for the deck in `directory` with `settings`; its `resume` goes on.

    Raises BadInput for a setting that would make it another flow.
    """
    for setting in settings:
        key = setting.partition("=")[0].strip()
        if key.split(".")[0] not in CHANGEABLE:
            parts = ", ".join(f"{part}.*" for part in CHANGEABLE)
            raise BadInput(
                f"--set {key}: a restart can change only {parts}; another {key} is another run "
                "(shockgrid run)"
            )
    deck = resolve_deck(read_toml(directory.deck), str(directory.deck), settings)
    return Runner(deck, directory, quiet)
