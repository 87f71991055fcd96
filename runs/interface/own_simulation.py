"""Running the blocks of a script like a packaged problem, and going on with such a run."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from problems.evolution import Evolution, get_material
from problems.own_simulation import Measure, OwnSimulation, OwnSimulationDeck
from regrid.errors import BadInput
from runs.deck.reading import ReadDeck, read_toml, resolve_deck
from runs.interface.case import Case
from runs.march.launching import check_changeable
from runs.store.directory import RunDirectory

NAME = "simulation"  # of the problem, in decks and folders
OWN_KEYS = ("run.max_steps", "output", "gauge")  # of the deck, or tables of it


def make_case(
    simulation: Evolution, settings: tuple[str, ...] = (), measure: Measure | None = None
) -> Case:
    """A case of a simulation that a script has made.

    settings: `key=value` of run.max_steps, output.* and gauge; all else is the simulation's own.
    Raises BadInput for other keys and for what is no simulation.
    """
    table = {"run": _describe_march(simulation)}
    return _make(
        simulation, table, f"a simulation of {_find_script() or 'Python'}", settings, measure
    )


def continue_case(
    directory: RunDirectory,
    simulation: Evolution,
    settings: tuple[str, ...] = (),
    measure: Measure | None = None,
) -> Case:
    """A case that goes on with the run in `directory` with blocks made anew by its script.

    Raises BadInput for a run of something else, for a simulation that has marched already, and
    where its blocks have other materials.
    """
    table = read_toml(directory.deck)
    if table.get("problem") != NAME:
        raise BadInput(
            f"{directory} is a run of {table.get('problem')}, which makes its blocks itself: "
            "restart it without simulation="
        )
    if simulation.step:
        raise BadInput(
            f"the simulation has made {simulation.step} steps already; a restart needs one as it "
            "was before its first step"
        )
    check_changeable(settings, OwnSimulationDeck)
    kept: dict[str, Any] = {key: table[key] for key in ("output", "gauge") if key in table}
    march = _describe_march(simulation)
    if "max_steps" in table.get("run", {}):
        march["max_steps"] = table["run"]["max_steps"]
    case = _make(simulation, {"run": march, **kept}, str(directory.deck), settings, measure)
    before, now = table.get("materials", {}), _describe_materials(simulation)
    if before != now:
        which = [name for name in {**before, **now} if before.get(name) != now.get(name)]
        name = which[0]
        raise BadInput(
            f"block {name!r} is of {now.get(name, 'no block')} in this simulation, of "
            f"{before.get(name, 'no block')} in the run in {directory}: that is another flow"
        )
    return case


def _make(simulation, table: dict[str, Any], origin: str, settings, measure) -> Case:
    for setting in settings:
        key = setting.partition("=")[0].strip()
        if not any(f"{key}.".startswith(f"{own}.") for own in OWN_KEYS):
            raise BadInput(
                f"{key}: a simulation of one's own has all but {', '.join(OWN_KEYS)} from its "
                "script; give it to shockgrid.Simulation or to its blocks"
            )
    table = {
        "problem": NAME,
        "script": _find_script(),
        "materials": _describe_materials(simulation),
        **table,
    }
    read: ReadDeck = resolve_deck(table, origin, settings)
    return Case(read, OwnSimulation(read.deck, simulation, measure))  # type: ignore[arg-type]


def _describe_march(simulation: Evolution) -> dict[str, Any]:
    """What the deck can say of how a simulation marches; BadInput where it is none."""
    if not isinstance(simulation, Evolution):
        raise BadInput(
            f"a {type(simulation).__name__} is no simulation; give a shockgrid.Simulation, a case "
            "of shockgrid.load, or the name of a problem or deck"
        )
    clock = getattr(simulation, "clock", None)
    march: dict[str, Any] = {"t_end": float(simulation.t_end)}
    if clock is not None:
        march |= {"cfl": float(clock.cfl), "threads": int(getattr(simulation, "threads", 1))}
    return march


def _describe_materials(simulation: Evolution) -> dict[str, str]:
    """Material and equation of state of each block, by which a run is known again."""
    words = {}
    for block in simulation.blocks:
        eos = getattr(block, "eos", None)
        kind = getattr(eos, "kind", type(eos).__name__)
        numbers = getattr(eos, "parameters", ())
        told = "" if eos is None else f", {kind} {' '.join(f'{n:.6g}' for n in numbers[:8])}"
        words[block.name] = f"{get_material(block)}{told}".rstrip()
    return words


def _find_script() -> str:
    """The name of the file that Python was started with; "" in a notebook."""
    return Path(getattr(sys.modules.get("__main__"), "__file__", None) or "").name
