"""A search for the name by which a kernel is called finds its text."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from builders import ROOT

PACKAGES = ("regrid", "hydro", "problems")
# one text made in several forms has their common name: solve_serial, solve_threaded
FORMS = ("barrier", "coarse", "serial", "smoothed", "threaded")


def read_trees() -> Iterator[tuple[Path, ast.Module]]:
    for package in PACKAGES:
        for path in sorted(ROOT.joinpath(package).rglob("*.py")):
            if path.parent.name != "compilation" and path.name != "jit.py":
                yield path, ast.parse(path.read_text(encoding="utf-8"))


def is_kernel(node: ast.AST) -> bool:
    """Whether a function is decorated as a kernel."""
    if not isinstance(node, ast.FunctionDef):
        return False
    marks = [one.func if isinstance(one, ast.Call) else one for one in node.decorator_list]
    return any(isinstance(mark, ast.Name) and mark.id == "kernel" for mark in marks)


def find_factories() -> dict[str, list[str]]:
    """The functions that make kernels, and the names of those."""
    made = {}
    for _, tree in read_trees():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and not is_kernel(node):
                names = [inner.name for inner in ast.walk(node) if is_kernel(inner)]
                if names:
                    made[node.name] = names
    return made


def find_last_name(node: ast.AST) -> str:
    return getattr(node, "attr", getattr(node, "id", ""))


def strip_form(name: str) -> str:
    """The name without the word for its form."""
    return "_".join(word for word in name.split("_") if word not in FORMS)


def test_entries_are_called_by_the_names_of_their_kernels():
    kernels = {node.name for _, tree in read_trees() for node in ast.walk(tree) if is_kernel(node)}
    assert len(kernels) > 150
    unknown = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node)}"
        for path, tree in read_trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and node.attr == "entry"
        and path.name != "plug_ins.py"
        and not {find_last_name(node.value), strip_form(find_last_name(node.value))} & kernels
    ]
    assert not unknown


def test_kernels_that_a_function_makes_keep_their_names():
    factories = find_factories()
    assert len(factories) > 12
    renamed = []
    for path, tree in read_trees():
        for node in ast.walk(tree):
            where = f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Call):
                if find_last_name(node.func.func) in factories:
                    renamed.append(f"{where}: called without a name")
            if not isinstance(node, ast.Assign) or not isinstance(node.value, ast.Call):
                continue
            names = factories.get(find_last_name(node.value.func), [])
            name = find_last_name(node.targets[0])
            if len(names) == 1 and strip_form(name) != names[0]:
                renamed.append(f"{where}: {name} for {names[0]}")
    assert not renamed
