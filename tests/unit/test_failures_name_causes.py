"""Every place that raises what ends a run names a cause that `runs.early_end.causes` explains."""

from __future__ import annotations

import ast

from builders import ROOT
from shockgrid.runs.early_end.causes import ENDS

KINDS = {"RunFailure", "RegridFailure"}


def find_calls():
    """(file:line, kind of error, the node given as cause or None) of all that are made."""
    for package in ("regrid", "hydro", "problems", "runs"):
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
                    continue
                if node.func.id in KINDS:
                    given = [key.value for key in node.keywords if key.arg == "cause"]
                    where = f"{path.relative_to(ROOT)}:{node.lineno}"
                    yield where, node.func.id, given[0] if given else None


def test_what_ends_a_run_names_a_known_cause():
    calls = list(find_calls())
    assert len(calls) > 20
    wrong = []
    for where, kind, given in calls:
        if given is None and kind == "RegridFailure":
            continue  # has a cause of its own
        if isinstance(given, ast.Constant) and given.value in ENDS:
            continue
        if isinstance(given, ast.Name | ast.Attribute):  # passed on from where it is named
            continue
        wrong.append(f"{where}: {ast.unparse(given) if given else 'no cause'}")
    assert not wrong, wrong
