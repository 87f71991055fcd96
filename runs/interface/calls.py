"""The commands as functions: they take and return data, and by default print nothing."""

from __future__ import annotations

import hashlib
import os
import re
import sys
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shockgrid.hydro.boundary import SEGMENTS, Segment
from shockgrid.hydro.eos import EQUATIONS_OF_STATE
from shockgrid.hydro.eos.base import EquationOfState
from shockgrid.hydro.history import INSTALLED, REGISTERED
from shockgrid.hydro.strength.laws import STRENGTH_LAWS, StrengthLaw
from shockgrid.problems.evolution import Evolution, get_material
from shockgrid.problems.own_simulation import Measure, OwnSimulation, OwnSimulationDeck
from shockgrid.problems.problem import Problem
from shockgrid.problems.registry import PROBLEMS
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.registry import REGRIDDERS
from shockgrid.runs.deck.reading import ReadDeck, read_toml, resolve_deck
from shockgrid.runs.interface.case import (
    Case,
    HooksGiven,
    OpenRun,
    finish,
    join_hooks,
    load,
    make_settings,
    open_run,
    say,
)
from shockgrid.runs.interface.wording import said_in_python
from shockgrid.runs.march.launching import (
    check_changeable,
    check_requests,
    read_restart_deck,
    remap_runner,
)
from shockgrid.runs.march.runner import Runner
from shockgrid.runs.ranks.started import check_single
from shockgrid.runs.store.directory import RunDirectory, open_directory
from shockgrid.runs.store.provenance import NOTED_DIGITS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


NAME = "simulation"  # of the problem, in decks and folders
OWN_KEYS = ("run.max_steps", "output", "gauge")  # of the deck, or tables of it


def make_case(
    simulation: Evolution,
    settings: tuple[str, ...] = (),
    measure: Measure | None = None,
    begun: RunDirectory | None = None,
) -> Case:
    """A case of a simulation that a script has made; begun: the directory of a run to continue.

    settings: `key=value` of run.max_steps, output.* and gauge; the simulation defines the rest.
    Raises BadInput for other keys, for an object that is not a simulation, and, when continuing, if
    the simulation has made steps or its blocks have other materials.
    """
    table: dict[str, Any] = {"problem": NAME, "run": _describe_march(simulation)}
    table |= {"script": _find_script(), "materials": _describe_materials(simulation)}
    origin = f"a simulation of {_find_script() or 'Python'}"
    if begun is not None:
        origin = str(begun.deck)
        check_changeable(settings, OwnSimulationDeck)
        before = read_toml(begun.deck)
        now = table["materials"]
        if before.get("problem") != NAME:
            raise BadInput(
                f"{begun} is a run of {before.get('problem')}, which makes its blocks itself: "
                "restart it without simulation="
            )
        if simulation.step:
            raise BadInput(
                f"the simulation has made {simulation.step} steps already; a restart needs one "
                "before its first step"
            )
        was = before.get("materials", {})
        for name in {**was, **now}:
            if was.get(name) != now.get(name):
                raise BadInput(
                    f"block {name!r} is of {now.get(name, 'no block')} in this simulation, of "
                    f"{was.get(name, 'no block')} in the run in {begun}: these are different flows"
                )
        table |= {key: before[key] for key in ("output", "gauge") if key in before}
        most = before.get("run", {}).get("max_steps")
        table["run"] |= {} if most is None else {"max_steps": most}
    for setting in settings:
        key = setting.partition("=")[0].strip()
        if not any(f"{key}.".startswith(f"{own}.") for own in OWN_KEYS):
            raise BadInput(
                f"{key}: your own simulation has all but {', '.join(OWN_KEYS)} from its "
                "script; give it to shockgrid.Simulation or to its blocks"
            )
    read: ReadDeck = resolve_deck(table, origin, settings)
    return Case(read, OwnSimulation(read.deck, simulation, measure))  # type: ignore[arg-type]


def _describe_march(simulation: Evolution) -> dict[str, Any]:
    """The time stepping of a simulation as keys of a deck; BadInput if it is not a simulation."""
    if not isinstance(simulation, Evolution):
        raise BadInput(
            f"a {type(simulation).__name__} is not a simulation; give a shockgrid.Simulation, a "
            "case of shockgrid.load, or the name of a problem or deck"
        )
    march: dict[str, Any] = {"t_end": float(simulation.t_end)}
    if clock := getattr(simulation, "clock", None):
        march |= {"cfl": float(clock.cfl), "threads": int(getattr(simulation, "threads", 1))}
    return march


def _describe_materials(simulation: Evolution) -> dict[str, str]:
    """Material and equation of state of each block, to recognise the run in a restart."""
    tables = {}
    for block in simulation.blocks:
        tables[block.name] = get_material(block)
        if eos := getattr(block, "eos", None):
            numbers = " ".join(map(_describe_parameter, getattr(eos, "parameters", ())[:8]))
            tables[block.name] += f", {getattr(eos, 'kind', type(eos).__name__)} {numbers}".rstrip()
    return tables


def _describe_parameter(value: Any) -> str:
    """A number, or the size and digest of an array, such as a table of pressures."""
    if np.ndim(value) == 0:
        return f"{value:.6g}"
    array = np.ascontiguousarray(value)
    digest = hashlib.sha256(array.tobytes()).hexdigest()[:NOTED_DIGITS]
    return f"{' x '.join(map(str, array.shape))} numbers {digest}"


def _find_script() -> str:
    """The name of the file that Python was started with; "" in a notebook."""
    return Path(getattr(sys.modules.get("__main__"), "__file__", None) or "").name


Run = str | os.PathLike  # a directory, or an opened run


def run(
    what: Case | Evolution | str | Path,
    directory: str | Path | None = None,
    *,
    dumps: int | None = None,
    hooks: HooksGiven = (),
    measure: Measure | None = None,
    force: bool = False,
    quiet: bool = True,
    **settings: Any,
) -> OpenRun:
    """Run a problem, a deck, a case or your own simulation into a run directory; the run as data.

    what: a name or file as for `load`, whose deck `settings` override; a `Case`; or a `Simulation`,
    which has everything that packaged problems have.  Its settings are `run={"max_steps": n}` and
    `output={...}`.  measure: for a simulation, a function of it that returns history columns, with
    the same names at every step.  directory, dumps, hooks, force, quiet, errors: see `Case.run`.
    """
    check_single("shockgrid.run", "run DECK")
    if measure is not None and isinstance(what, Case | str | Path):
        raise BadInput("measure is for your own simulation; a problem has its own columns")
    if isinstance(what, Case):
        if settings:
            names = ", ".join(settings)
            raise BadInput(f"{names}: the deck of a case is that given to shockgrid.load")
        case = what
    elif isinstance(what, str | Path):
        case = load(what, **settings)
    else:
        with said_in_python():
            case = make_case(what, make_settings(settings), measure)
    return case.run(directory, dumps=dumps, hooks=hooks, force=force, quiet=quiet)


def restart(
    directory: Run,
    *,
    simulation: Evolution | None = None,
    measure: Measure | None = None,
    at: int | None = None,
    cells: int | Sequence[int] | None = None,
    output: str | Path | None = None,
    force: bool = False,
    hooks: HooksGiven = (),
    quiet: bool = True,
    **settings: Any,
) -> OpenRun:
    """Continue a run from its last restart point, or from that of step `at`; the run as data.

    simulation: for a run of your own blocks, the same blocks rebuilt.  cells: a new value of the
    deck's key of that name; the state is remapped, and the run continues in `output`
    [out/<problem>-<n>], without hooks.  measure, hooks: as in the first part of the run.  settings:
    keys of the deck that control the computation, such as run.t_end and output.*.  Raises BadInput
    if the run, the problem's file or the settings do not allow a restart; else see `Case.run`.
    """
    check_single("shockgrid.restart", "restart DIR")
    opened = open_directory(directory)
    changed = make_settings(settings)
    if cells is not None:
        if hooks:
            raise BadInput(
                "hooks: a restart on other cells has none; restart the result with hooks"
            )
        number = str(cells).strip("[()] ")
        place = None if output is None else str(output)
        with said_in_python():
            runner = remap_runner(opened, number, changed, at, place, force, quiet, say)
        return finish(runner, runner.start(), quiet)
    if output is not None or force:
        raise BadInput("output and force need cells; otherwise a run continues in its directory")
    with said_in_python():
        if simulation is not None:
            case = make_case(simulation, changed, measure, opened)
        else:
            read = read_restart_deck(opened, changed, at)
            case = Case(read, read.make_problem())
        # the simulation says what is missing where the blocks are a script's
        gauges = check_requests(case.read, case.simulation)
    after_step = join_hooks(case, hooks)
    flow = case.problem, case.simulation
    runner = Runner(case.read, opened, *flow, gauges, quiet, after_step)
    return case.march(runner, lambda: runner.resume(at), quiet)


def plot(directory: Run, *fields: str, **options: Any) -> Figure:
    """The figure that `shockgrid plot` draws of a run; for options see `OpenRun.plot`."""
    return open_run(directory).plot(*fields, **options)


def verify(*problems: str, short: bool = False) -> list[dict[str, Any]]:
    """Run the standard problems, or those named, at fixed sizes; returns a record of each result.

    A record has "problem", "what", "size", "error", "order", "bar" and "met", with None for a
    missing value.  short: one small size of each.  Raises BadInput for an unknown name.
    """
    from shockgrid.runs.verify import choose_cases, compute_records

    return list(compute_records(choose_cases(problems), short))


PLAIN = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
_OWN: dict[tuple[str, str], str] = {}  # what was registered here: kind and name, and its class


def register(
    name: str, thing: type | Callable[..., Any], *, units: Mapping[str, str] | None = None
) -> None:
    """Register by name a class (a problem, equation of state, law of strength, boundary kind or
    regridder) or a function: a group of history columns, for `output.columns` of a deck.

    A regridder is a class with a method `regrid(previous, boundary)`.  A group
    of columns takes the flow after a step and returns numbers by column name; units: of these
    columns.  A new version may be registered again under its name.  Raises BadInput for any other
    thing, for a name that is taken, and for one with characters other than lower-case letters,
    digits and hyphens.
    """
    if not callable(thing):
        raise BadInput(
            f"{name!r}: only classes and functions can be registered, not a {type(thing).__name__}"
        )
    if not PLAIN.fullmatch(name):
        raise BadInput(f"{name!r} is not a valid name: use lower-case letters, digits and hyphens")
    if not isinstance(thing, type):
        _register_columns(name, thing, dict(units or {}))
        return
    if units is not None:
        raise BadInput(f"{name!r}: units are those of a function's history columns")
    place = f"{thing.__module__}:{thing.__qualname__}"
    kinds: tuple[tuple[str, MutableMapping[str, Any], bool, Any], ...] = (
        ("problem", PROBLEMS, issubclass(thing, Problem), place),
        ("equation of state", EQUATIONS_OF_STATE, issubclass(thing, EquationOfState), thing),
        ("law of strength", STRENGTH_LAWS, issubclass(thing, StrengthLaw), thing),
        ("boundary kind", SEGMENTS, issubclass(thing, Segment), thing),
        ("regridder", REGRIDDERS, callable(getattr(thing, "regrid", None)), place),
    )
    for kind, registry, fits, value in kinds:
        if not fits:
            continue
        if "<locals>" in place:
            raise BadInput(f"{thing.__qualname__}: a class inside a function cannot be registered")
        if name in registry and _OWN.get((kind, name)) != place:
            raise BadInput(f"there is a {kind} {name!r} already; choose another name")
        registry[name] = value
        _OWN[kind, name] = place
        return
    raise BadInput(
        f"{thing.__name__} is not a problem, equation of state, law of strength, boundary kind or "
        "regridder: it derives from none of these classes and has no method `regrid`"
    )


@dataclass(frozen=True)
class ColumnsWithUnits:
    """A group of history columns, any callable, with the units of these."""

    compute: Callable[..., Any]
    units: Mapping[str, str]

    def __call__(self, flow: Any) -> Any:
        return self.compute(flow)


def _register_columns(name: str, group: Callable[..., Any], units: dict[str, str]) -> None:
    """A group of history columns with its units."""
    if name in INSTALLED:
        raise BadInput(f"there is a group of history columns {name!r} already; choose another name")
    REGISTERED[name] = ColumnsWithUnits(group, units) if units else group
