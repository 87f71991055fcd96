"""All problems by name, one line each; a problem's module is imported when it is asked for."""

from __future__ import annotations

import importlib
import importlib.util
from collections import ChainMap
from typing import TYPE_CHECKING, Any

from shockgrid.problems.problem_file import is_problem_file, read_head, read_problem_file
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.plug_ins import PlugIns

if TYPE_CHECKING:
    from shockgrid.problems.problem import Problem

# by subject, in the order of `shockgrid list`
SUBJECTS: dict[str, dict[str, str]] = {
    "interfaces": {
        "interface-instability": "shockgrid.problems.interface_instability.problem"
        ":InterfaceInstability",
        "rayleigh-taylor": "shockgrid.problems.standard.rayleigh_taylor:RayleighTaylor",
        "shock-bubble": "shockgrid.problems.shock_bubble:ShockBubble",
        "triple-point": "shockgrid.problems.standard.triple_point:TriplePoint",
    },
    "plates, impacts and cones": {
        "plate-on-wedge": "shockgrid.problems.plate_on_wedge.problem:PlateOnWedge",
        "flyer-target": "shockgrid.problems.standard.flyer_target:FlyerTarget",
        "cavity": "shockgrid.problems.standard.cavity:Cavity",
        "conical-target": "shockgrid.problems.conical_target.problem:ConicalTarget",
        "detonation": "shockgrid.problems.standard.detonation:Detonation",
    },
    "solids with strength": {
        "elastic-piston": "shockgrid.problems.standard.elastic_piston:ElasticPiston",
        "taylor-bar": "shockgrid.problems.standard.taylor_bar:TaylorBar",
        "shell": "shockgrid.problems.standard.shell:CollapsingShell",
        "rippled-surface": "shockgrid.problems.standard.rippled_surface:RippledSurface",
        "flying-plate": "shockgrid.problems.standard.flying_plate:FlyingPlate",
        "elastic-waves": "shockgrid.problems.standard.elastic_waves:ElasticWaves",
    },
    "verification against exact solutions": {
        "riemann": "shockgrid.problems.riemann:Riemann",
        "free-stream": "shockgrid.problems.standard.free_stream:FreeStream",
        "vortex": "shockgrid.problems.standard.vortex:Vortex",
        "gresho": "shockgrid.problems.standard.gresho:Gresho",
        "taylor-green": "shockgrid.problems.standard.taylor_green:TaylorGreen",
        "noh": "shockgrid.problems.standard.noh:Noh",
        "sedov": "shockgrid.problems.standard.sedov:Sedov",
        "kidder": "shockgrid.problems.standard.kidder:Kidder",
        "saltzmann": "shockgrid.problems.standard.saltzmann:Saltzmann",
        "oblique-shock": "shockgrid.problems.standard.oblique_shock:ObliqueShock",
    },
    "convection and viscous flow": {
        "heated-cavity": "shockgrid.problems.convection.heated_cavity:HeatedCavity",
        "rayleigh-benard": "shockgrid.problems.convection.rayleigh_benard:RayleighBenard",
        "convection-1d": "shockgrid.problems.convection.convection_1d:Convection1D",
        "moving-grid-1d": "shockgrid.problems.convection.moving_grid_1d:MovingGrid1D",
    },
    "grids without flow": {
        "grid-march": "shockgrid.problems.grid_march:GridMarch",
    },
    "your own blocks": {
        "blocks": "shockgrid.problems.blocks:Blocks",
    },
}
OWN = {name: place for listed in SUBJECTS.values() for name, place in listed.items()}
INSTALLED = PlugIns("shockgrid.problems")  # of other packages
# where each is, "module:class"; of an installed package, the class itself
PROBLEMS: ChainMap[str, Any] = ChainMap(OWN, INSTALLED)  # type: ignore
# run by name from a run directory, not from a deck of one's own: in no list
INNER: dict[str, str] = {"simulation": "shockgrid.problems.own_simulation:OwnSimulation"}


def is_problem(name: object) -> bool:
    """Is there a problem of this name, or is it that of a file which may hold one?"""
    return is_problem_file(name) or name in PROBLEMS or name in INNER


def load_problem(name: str) -> type[Problem]:
    """The class of problem `name`, a name or a Python file; BadInput with the nearest name."""
    if is_problem_file(name):
        return read_problem_file(name).problem
    if name not in INNER and name not in PROBLEMS:
        raise BadInput(f"there is no problem {name!r}{suggest(name, PROBLEMS)}")
    found = INNER.get(name) or PROBLEMS[name]
    if not isinstance(found, str):
        return found
    module, _, attribute = found.partition(":")
    return getattr(importlib.import_module(module), attribute)


def read_docstring(name: str) -> str:
    """The docstring of a problem's module, read without importing it; "" where it is missing."""
    if is_problem_file(name):
        return read_head(name)
    place = INNER.get(name) or OWN.get(name) or INSTALLED.find(name).value
    try:
        spec = importlib.util.find_spec(place.partition(":")[0])
    except Exception:  # a package above the module cannot be imported
        return ""
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return ""
    return read_head(spec.origin)


def summary_line(name: str) -> str:
    """The first line of a problem's docstring, for `shockgrid list`."""
    return (read_docstring(name) or "(not there yet)").splitlines()[0]
