"""The shape of the source: imports point one way, rooms say what they are, names resolve."""

from __future__ import annotations

import ast
import functools
import gc
import graphlib
import importlib.util
from pathlib import Path

import pytest

from builders import ROOT
from shockgrid.problems.registry import PROBLEMS, summary_line
from shockgrid.runs.cli.main import cli

ORDER = ("regrid", "hydro", "problems", "runs", "shockgrid")
# rooms by rising floor: a room imports those of lower floors and, in its own package, nothing else
ROOMS = (
    ("regrid.errors",),
    ("regrid.compilation",),
    ("regrid.hdf5_files", "regrid.jit", "regrid.plug_ins", "regrid.roots", "regrid.text_files",
     "regrid.work_arrays"),
    ("regrid.sides",),
    ("regrid.protocol",),
    ("regrid.curves", "regrid.measure", "regrid.spacings", "regrid.symmetry"),
    ("regrid.algebraic",),
    ("regrid.barrier", "regrid.domains", "regrid.domains_in_space", "regrid.node_speeds"),
    ("regrid.hexahedra",),
    ("regrid.plot3d",),
    ("regrid.equidistribution", "regrid.given", "regrid.marching"),
    ("regrid.variational", "regrid.winslow"),
    ("regrid.registry",),
    ("hydro.rows", "hydro.strength.laws"),
    ("hydro.formulas", "hydro.eos", "hydro.rim"),
    ("hydro.burn",),
    ("hydro.workers", "hydro.clock"),
    ("hydro.interior", "hydro.convection"),
    ("hydro.perimeter",),
    ("hydro.kernels", "hydro.totals", "hydro.carried"),
    ("hydro.strength.spall",),
    ("hydro.strength",),
    ("hydro.mixture",),
    ("hydro.block",),
    ("hydro.phases",),
    ("hydro.ranks",),
    ("hydro.boundary", "hydro.crowding", "hydro.ledger"),
    ("hydro.redistribution",),
    ("hydro.small_cells",),
    ("hydro.facets",),
    ("hydro.sliding",),
    ("hydro.links",),
    ("hydro.motion", "hydro.sources"),
    ("hydro.contacts",),
    ("hydro.step",),
    ("hydro.history",),
    ("hydro.simulation",),
    ("hydro.remap",),
    ("problems.prefixes",),
    ("problems.deck", "problems.evolution", "problems.pictures"),
    ("problems.signals", "problems.memory"),
    ("problems.report",),
    ("problems.problem",),
    ("problems.problem_file", "problems.own_simulation"),
    ("problems.column_groups",),
    ("problems.registry", "problems.grid_march"),
    ("problems.references",),
    ("problems.initial_states", "problems.measured_traces", "problems.solids"),
    ("problems.interface_instability", "problems.plate_on_wedge", "problems.conical_target",
     "problems.shock_bubble", "problems.riemann", "problems.blocks", "problems.standard",
     "problems.convection"),
    ("runs.quantities", "runs.signals"),
    ("runs.deck", "runs.engines"),
    ("runs.store",),
    ("runs.ranks",),
    ("runs.inspection", "runs.gauges"),
    ("runs.pictures",),
    ("runs.early_end",),
    ("runs.forecast",),
    ("runs.march",),
    ("runs.grids", "runs.verify"),
    ("runs.study",),
    ("runs.report",),
    ("runs.interface",),
    ("runs.cli",),
    ("shockgrid.testing",),
    ("shockgrid.command",),
    ("shockgrid.__main__",),
)  # fmt: skip
INNER = ORDER[:4]  # folders that are installed inside `shockgrid`; ROOMS names them without it
SOURCES = sorted(path for package in ORDER for path in (ROOT / package).rglob("*.py"))


def name_module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def shorten(module: str) -> str:
    """The name of a module as ROOMS has it, of its name in an import."""
    inside = module.removeprefix("shockgrid.")
    return inside if inside.split(".")[0] in INNER else module


@functools.cache
def parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@functools.cache
def find_imports() -> dict[str, set[str]]:
    """Project modules that each module imports, those for type checking and in functions too."""
    modules = {name_module(path): path for path in SOURCES}
    found = {}
    for name, path in modules.items():
        targets = set()
        for node in ast.walk(parse(path)):
            if isinstance(node, ast.Import):
                targets |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{name}: imports are absolute"
                inside = {f"{node.module}.{alias.name}" for alias in node.names}
                known = {one for one in inside if shorten(one) in modules}
                targets |= known or {node.module}
        strangers = {target.split(".")[0] for target in targets} & {*INNER, "tests", "benchmarks"}
        assert not strangers, f"{name} imports {strangers}"
        found[name] = (set(map(shorten, targets)) & modules.keys()) - {name}
    return found


def find_room(module: str) -> str:
    path = ROOT.joinpath(*module.split("."))
    return module if path.is_dir() or module.count(".") == 1 else module.rpartition(".")[0]


def test_no_circles_of_imports():
    sorter = graphlib.TopologicalSorter(find_imports())
    try:
        sorter.prepare()
    except graphlib.CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_names_that_are_imported_exist():
    """Those inside functions, too, which no start would notice."""
    missing = []
    for path in SOURCES:
        for node in ast.walk(parse(path)):
            if not isinstance(node, ast.ImportFrom) or not str(node.module).startswith("shockgrid"):
                continue
            module = importlib.import_module(node.module)
            for alias in node.names:
                inside = f"{node.module}.{alias.name}"
                if not hasattr(module, alias.name) and importlib.util.find_spec(inside) is None:
                    missing.append(f"{name_module(path)}:{node.lineno}: {inside}")
    assert not missing, missing


def test_imports_point_one_way():
    floors = {room: floor for floor, rooms in enumerate(ROOMS) for room in rooms}
    wrong = []
    for module, targets in find_imports().items():
        room = find_room(module)
        assert room in floors or room in ORDER, f"{room} has no floor in ROOMS"
        for target in map(find_room, targets):
            if room in ORDER:  # the package itself
                higher = ORDER.index(target.split(".")[0]) > ORDER.index(room)
            else:
                higher = target != room and floors[target] >= floors[room]
            if higher:
                wrong.append(f"{module} imports {target}")
    assert not wrong, wrong


@pytest.mark.parametrize("name", PROBLEMS)
def test_registry_names_resolve(name):
    module, _, attribute = PROBLEMS[name].partition(":")
    spec = importlib.util.find_spec(module)
    assert spec is not None, f"{module} does not exist"
    tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    assert attribute in {node.name for node in tree.body if isinstance(node, ast.ClassDef)}
    assert len(summary_line(name)) <= 90


def test_every_command_explains_itself():
    assert list(cli.commands)[:3] == ["list", "run", "restart"]
    for command in cli.commands.values():
        assert command.help
        for parameter in command.params:
            assert parameter.param_type_name == "argument" or parameter.help


@pytest.mark.parametrize(
    "decks",  # some kernels are made for materials
    [
        ("plate-on-wedge", "interface-instability"),
        pytest.param(("conical-target", "detonation"), marks=pytest.mark.slow),
    ],
)
def test_no_kernel_holds_a_compiled_function_in_its_closure(decks):
    from numba.core.dispatcher import Dispatcher

    from shockgrid.runs.deck.reading import read_deck

    for package in ORDER[:3]:
        for path in sorted((ROOT / package).rglob("*.py")):
            importlib.import_module(f"shockgrid.{name_module(path)}")
    for deck in decks:
        read_deck(deck).make_problem().build()
    # by type: an instance check would ask proxies for what they stood for, which may be gone
    kernels = [thing for thing in gc.get_objects() if issubclass(type(thing), Dispatcher)]
    own = [kernel.py_func for kernel in kernels if hasattr(kernel, "py_func")]
    own = [function for function in own if shorten(str(function.__module__)) != function.__module__]
    assert len(own) > 50
    held = [
        f"{function.__module__}.{function.__qualname__}: {name}"
        for function in own
        for name, cell in zip(
            function.__code__.co_freevars, function.__closure__ or (), strict=True
        )
        if isinstance(cell.cell_contents, Dispatcher)
    ]
    assert not held


def test_few_files_know_what_a_cell_holds():
    """Another number in a cell costs the list, the conversion and the kernels that load rows."""
    knowing = {name_module(path) for path in SOURCES if "void_energy" in path.read_text("utf-8")}
    assert knowing == {
        "hydro.rows",
        "hydro.eos.conversion",
        "hydro.interior.advance",
        "hydro.interior.update",
        "hydro.perimeter.strips",
    }
