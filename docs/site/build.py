"""What the site has besides the pages of docs/: the reference, and the files for formulas.

A hook of mkdocs (mkdocs.yml).  One page a room: its docstring, then its modules with everything
public in them, read from the sources without importing them.  The formulas are typeset in the
browser by a copy of MathJax that a Python package brings along, so that no page and no build
fetches anything.
"""

from __future__ import annotations

import ast
from importlib import metadata
from pathlib import Path

from mkdocs.structure.files import File, Files

import shockgrid

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("shockgrid", "runs", "problems", "hydro", "regrid")
MATHJAX = "django-static-mathjax"  # no more than MathJax's files in a wheel
WANTED = ("tex-chtml.js", "output/chtml/fonts/woff-v2/")


def list_rooms(package: str) -> list[Path]:
    """The folders of a package, itself first, each before those inside it."""
    return sorted(path.parent for path in (ROOT / package).rglob("__init__.py"))


def name_module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def name_page(room: Path) -> str:
    """The page of a room; a package's own is the first of its group."""
    package, _, inner = name_module(room).partition(".")
    return f"reference/{package}/{inner or 'index'}.md"


def write_page(room: Path) -> str:
    """The page of a room in Markdown: headings and requests to the docstring reader."""
    name = name_module(room)
    text = ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8"))) or ""
    modules = [path for path in sorted(room.glob("*.py")) if not path.name.startswith("__")]
    parts = ["---\nsearch:\n  boost: 0.3\n---", f"# {name}", text]  # found after the pages
    if name == "shockgrid":
        found = shockgrid.MODULES.items()
        names = [
            f"- [`{one}`][{module}.{shockgrid.ELSEWHERE.get(one, one)}]" for one, module in found
        ]
        parts.append("Names to import from it:\n\n" + "\n".join(names))
    parts += [f"::: {name_module(path)}" for path in modules]
    return "\n\n".join(parts) + "\n"


def on_config(config):
    """Put the reference into the navigation, that of `shockgrid` first, and list the problems."""
    problems = sorted(Path(config.docs_dir, "problems").glob("*.md"))
    for entry in config.nav:
        if entry.get("Problems") == "problems/":
            entry["Problems"] = [{path.stem: f"problems/{path.name}"} for path in problems]
        if "In Python" in entry:
            entry["In Python"].insert(0, {"import shockgrid as sg": name_page(ROOT / "shockgrid")})
    groups = []
    for package in PACKAGES[1:]:
        first, *rooms = list_rooms(package)
        entries = [{name_module(room).partition(".")[2]: name_page(room)} for room in rooms]
        groups.append({package: [name_page(first), *entries]})  # a bare page: that of the group
    config.nav.append({"Reference": groups})
    return config


def on_files(files: Files, config):
    """Add the pages of the reference and the files of MathJax."""
    for package in PACKAGES:
        for room in list_rooms(package):
            files.append(File.generated(config, name_page(room), content=write_page(room)))
    for file in metadata.files(MATHJAX) or ():
        _, found, inner = str(file).partition("/es5/")
        if found and inner.startswith(WANTED):
            source = str(file.locate())
            files.append(File.generated(config, f"mathjax/{inner}", abs_src_path=source))
    return files
