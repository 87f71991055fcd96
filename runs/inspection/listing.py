"""The text of `list`, `materials` and `run --dry-run`."""

from __future__ import annotations

import re
import textwrap
from dataclasses import fields
from pathlib import Path
from typing import Any

from shockgrid.problems.problem_file import is_problem_file
from shockgrid.problems.registry import INSTALLED, PROBLEMS, SUBJECTS, read_docstring, summary_line
from shockgrid.problems.registry import OWN as OWN_PROBLEMS
from shockgrid.regrid.compilation.first_calls import interpreted
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.plug_ins import GROUPS, find_plug_ins
from shockgrid.runs.deck.reading import ReadDeck, packaged_decks, read_toml, suggest_deck
from shockgrid.runs.quantities import add_unit, is_time

AUTHOR = r"\b[A-Z]\. (?:[A-Z]\. )*([A-Z][a-z]+)\b"  # initials and a surname
SHORT = r".{1,70}(?=[:;] |\.?$)|.*"  # the longest beginning that is a clause


def describe_all() -> str:
    """All problems by subject, each with its packaged decks."""
    decks: dict[str, list[tuple[str, str]]] = {}
    for name, path in packaged_decks().items():
        problem = str(read_toml(path).get("problem"))
        if name != problem:
            decks.setdefault(problem, []).append((name, describe_deck(path)))
    lines = []
    listed = {name for names in SUBJECTS.values() for name in names}
    others = [name for name in OWN_PROBLEMS if name not in listed]  # registered by a script
    for subject, names in {**SUBJECTS, "others": others}.items():
        lines += [f"\n{subject.upper()}"] * bool(names)
        for name in names:
            rows = [(name, summary_line(name)), *((f"  {n}", w) for n, w in decks.get(name, ()))]
            lines += [f"{one:40} {re.match(SHORT, summary)[0]}" for one, summary in rows]  # type: ignore
    usage = "shockgrid run NAME; shockgrid list NAME: description; shockgrid check NAME: its keys"
    return "\n".join([*lines, *describe_installed(), "", usage]).strip()


def describe_installed() -> list[str]:
    """Lines on the parts that other installed packages provide, with their origin.

    Names that shockgrid or a second package also has are marked as not used.
    """
    plug_ins = {group: find_plug_ins(group) for group in GROUPS}
    if not any(plug_ins.values()):
        return []
    from shockgrid.hydro.boundary import OWN_SEGMENTS
    from shockgrid.hydro.eos import OWN as OWN_EQUATIONS
    from shockgrid.hydro.history import COLUMNS
    from shockgrid.hydro.strength.laws import OWN as OWN_STRENGTH_LAWS
    from shockgrid.regrid.registry import OWN as OWN_REGRIDDERS

    own = {
        "shockgrid.problems": OWN_PROBLEMS,
        "shockgrid.eos": OWN_EQUATIONS,
        "shockgrid.strength": OWN_STRENGTH_LAWS,
        "shockgrid.regridders": OWN_REGRIDDERS,
        "shockgrid.boundaries": OWN_SEGMENTS,
        "shockgrid.columns": COLUMNS,
    }
    lines = []
    for group, kind in GROUPS.items():
        found = plug_ins[group]
        for one in found:
            status = ""
            if one.name in own[group]:
                status = "; not used: shockgrid has this name itself"
            elif sum(other.name == one.name for other in found) > 1:
                status = "; not used: two packages have this name"
            elif group == INSTALLED.group:
                status = f"; {summary_line(one.name)}"
            lines.append(f"  {one.name:20s}  {kind} of {one.origin}{status}")
    return ["", "from other packages:", *lines]


def describe_problem(name: str) -> str:
    """The docstring of a problem or of its file, or the packaged deck of that name."""
    if is_problem_file(name):
        return read_docstring(name) or f"{name} has no docstring"
    if name in PROBLEMS:
        own = [deck for deck in packaged_decks() if deck.startswith(name)]
        decks = f"\n\npackaged decks: {', '.join(own)}" if own else ""
        of = f"\n\nof the package {INSTALLED.find(name).origin}" if name not in OWN_PROBLEMS else ""
        return (read_docstring(name) or summary_line(name)) + decks + of
    if name in packaged_decks():
        return packaged_decks()[name].read_text(encoding="utf-8").rstrip()
    raise BadInput(f"there is no problem or deck {name!r}{suggest_deck(name)}")


def describe_materials(name: str | None = None) -> str:
    """A line for each material of the library, or the parameters and source of material `name`."""
    from shockgrid.hydro.eos.materials import LIBRARY, find_material, find_name, read_materials

    if name is not None:
        return describe_material(find_name(name), find_material(name))
    head = f"{'material':18}{'kind':18}{'density':>12}{'c0':>12}{'s':>7}{'HEL':>11}{'spall':>10}"
    lines = [f"{head}   {'source':18}other names"]
    for one, material in read_materials(LIBRARY).items():
        density = f"{material.rho0:g} kg/m3"
        line = f"{one:18}{material.eos.kind:18}{density:>12}{describe_hugoniot(material.eos)}"
        line += f"{describe_elastic_limit(material):>11}{describe_spall(material):>10}"
        line += f"   {shorten_source(material.source):18}"
        lines.append(f"{line}{', '.join(material.names)}".rstrip())
    legend = (
        "c0, s: of a straight Hugoniot, Us = c0 + s up; HEL: Hugoniot elastic limit, the stress of "
        "the strongest elastic shock, of materials with a law of strength; spall: the tension at "
        "which voids open"
    )
    usage = "shockgrid materials NAME: its parameters and their source"
    return "\n".join([*lines, "", *textwrap.wrap(legend, 90), usage])


def describe_material(name: str, material: Any) -> str:
    """The parameters of a material, its laws of strength and their sources."""
    lines = [f"{name}: {material.eos.kind}"]
    lines[0] += f", also {', '.join(material.names)}" if material.names else ""
    numbers = list_numbers(material.eos)
    if material.eos.heat_capacity > 0.0:
        numbers["heat_capacity"] = material.eos.heat_capacity
    lines += describe_numbers({"rho0": material.rho0} | numbers)
    lines += ["", *textwrap.wrap(f"source: {' '.join(material.source.split())}", 90)]
    for law, source in zip(material.strengths, material.strength_sources, strict=True):
        limit = describe_elastic_limit(material, law)
        lines += ["", f"strength law {law.kind}, Hugoniot elastic limit {limit}"]
        own = {law.keys.get(key, key): value for key, value in list_numbers(law).items()}
        lines += describe_numbers(own)
        lines += ["", *textwrap.wrap(f"source: {' '.join(source.split())}", 90)]
    if material.spall is not None:
        own = dict(material.spall)
        lines += ["", f"spall law {own.pop('law', '?')}", *describe_numbers(own)]
        lines += ["", *textwrap.wrap(f"source: {' '.join(material.spall_source.split())}", 90)]
    return "\n".join(lines)


def list_numbers(parts: Any) -> dict[str, Any]:
    """The parameters of an equation of state or a law of strength by name."""
    return {one.name: getattr(parts, one.name) for one in fields(parts) if one.init}


def describe_numbers(numbers: dict[str, Any]) -> list[str]:
    """A line for each parameter."""
    return [
        f"  {name} = {value:g}" if isinstance(value, float) else f"  {name} = {value}"
        for name, value in numbers.items()
    ]


def describe_hugoniot(eos: Any) -> str:
    """Two columns: c0 and s of a straight Hugoniot, empty for materials that have another."""
    if not hasattr(eos, "c0"):
        return f"{'':19}"
    speed = f"{eos.c0:g} m/s"
    return f"{speed:>12}{eos.s:>7g}"


def describe_elastic_limit(material: Any, law: Any = None) -> str:
    """The Hugoniot elastic limit by a law of strength, by default the first; "" without one."""
    if material.strength is None:
        return ""
    from shockgrid.problems.references.elastic_plastic import find_elastic_limit, make_solid_at_rest

    stress = find_elastic_limit(make_solid_at_rest(material, law)).stress
    return f"{1e-9 * stress:.3g} GPa"


def describe_spall(material: Any) -> str:
    """The tension at which voids open, or that of the law of spall; "" where there is none."""
    law_stress = (material.spall or {}).get("stress")
    tension = law_stress or getattr(material.eos, "strength", 0.0)
    return f"{1e-9 * tension:.3g} GPa" if tension > 0.0 else ""


def shorten_source(source: str) -> str:
    """The first author of a source, with the year; "ours", and "" where there is none."""
    if source.strip().startswith("ours"):
        return "ours"
    author = re.search(AUTHOR, source)
    year = re.search(r"\b(?:18|19|20)\d\d\b", source[author.end() :]) if author else None
    return f"{author[1]} {year[0]}" if author and year else ""


def describe_deck(path: Path) -> str:
    """The beginning of a deck's first comment, up to a semicolon or a bracket."""
    lines_of_deck = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        if not line.startswith("#:"):
            lines_of_deck.append(line.lstrip("# ").rstrip())
    return re.split(r"; | \(", " ".join(lines_of_deck))[0]


def describe_plan(deck: ReadDeck) -> str:
    """Blocks, cells, memory, end time and cautions of the run that a deck would make."""
    from shockgrid.problems.problem import plan_blocks
    from shockgrid.runs.inspection.account import describe_cautions
    from shockgrid.runs.inspection.info import other_name
    from shockgrid.runs.quantities import count

    with deck.numbers_in_reach(), interpreted():
        problem = deck.make_problem()
        plan = problem.plan()
        if plan is None:
            problem.check_memory()  # it is built to be looked at
        evolution = problem.build() if plan is None else None
    if evolution is not None:
        t_end = evolution.t_end
        blocks = plan_blocks({b.name + other_name(b): b.nodes for b in evolution.blocks})
    else:
        t_end, blocks = plan
    unit = problem.t_unit
    march = f"t = 0 to {add_unit(t_end, unit)}" if is_time(unit) else f"at most {t_end:g} {unit}"
    length = "1" if unit == "1" else "m"
    lines = [f"{deck.problem} ({deck.described}), {march}"]
    for block in blocks:
        ni, nj = block.cells
        low = block.low
        high = block.high
        lines.append(
            f"block {block.name}: {ni} x {nj} cells, "
            f"x {low[0]:.4g} to {add_unit(high[0], length, 4)}, "
            f"y {low[1]:.4g} to {add_unit(high[1], length, 4)}"
        )
    run = deck.deck.run
    output = deck.deck.output
    limit = f", at most {run.max_steps} steps" if run.max_steps is not None else ""
    dumps = count(output.dumps + 1, "dump")
    threads = count(run.threads, "thread") if run.threads else "one thread per large block"
    lines.append(f"{dumps}, {threads}{limit}; nothing was run")
    with interpreted():
        return "\n".join(lines + describe_cautions(problem))
