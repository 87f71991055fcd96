"""What the site has besides the pages of docs/: the reference, and the files for formulas.

A hook of mkdocs (mkdocs.yml).  One page a room: its docstring, then its modules with everything
public in them, read from the sources without importing them.  The formulas are typeset in the
browser by a copy of MathJax that a Python package brings along, so that no page and no build
fetches anything.
"""

from __future__ import annotations

import ast
import json
import re
from importlib import metadata
from pathlib import Path

from mkdocs.structure.files import File, Files
from pylatexenc.latex2text import LatexNodes2Text

import shockgrid

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("shockgrid", "runs", "problems", "hydro", "regrid")
MATHJAX = "django-static-mathjax"  # no more than MathJax's files in a wheel
WANTED = ("tex-chtml.js", "output/chtml/fonts/woff-v2/")


def list_rooms(package: str) -> list[Path]:
    """The folders of a package, itself first, each before those inside it."""
    return sorted(path.parent for path in (ROOT / package).rglob("__init__.py"))


def name_module(path: Path) -> str:
    """The name by which a folder or a file is imported."""
    package, *inner = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(["shockgrid", *([package] if package != "shockgrid" else []), *inner])


def find_module(name: str) -> Path:
    """The folder or file of a module, without its ending."""
    parts = name.split(".")
    inside = len(parts) > 1 and parts[1] in PACKAGES
    return ROOT.joinpath(*parts[1:] if inside else parts)


def name_page(room: Path) -> str:
    """The page of a room; a package's own is the first of its group."""
    package, *rooms = room.relative_to(ROOT).parts
    inner = ".".join(rooms)
    return f"reference/{package}/{inner or 'index'}.md"


def write_page(room: Path) -> str:
    """The page of a room in Markdown: headings and requests to the docstring reader."""
    name = name_module(room)
    text = ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8"))) or ""
    modules = [path for path in sorted(room.glob("*.py")) if not path.name.startswith("__")]
    parts = ["---\nsearch:\n  boost: 0.3\n---", f"# {name}", text]  # found after the pages
    if name == "shockgrid":
        parts.append(describe_names())
    parts += [f"::: {name_module(path)}" for path in modules]
    return "\n\n".join(parts) + "\n"


def describe_names() -> str:
    """A table with a line for each public name: what it is, by the first sentence about it."""
    rows = []
    for one, module in sorted(shockgrid.MODULES.items(), key=lambda item: item[0].lower()):
        inner = shockgrid.ELSEWHERE.get(one, one)
        rows.append(f"| [`sg.{one}`][{module}.{inner}] | {find_sentence(module, inner)} |")
    return "\n".join(["| name | what it is |", "|---|---|", *rows])


def find_sentence(module: str, name: str) -> str:
    """The first sentence of the docstring of a class, function or module."""
    path = find_module(module)
    path = path / f"{name}.py" if (path / f"{name}.py").is_file() else path.with_suffix(".py")
    tree = ast.parse(path.read_text(encoding="utf-8"))
    kinds = ast.ClassDef | ast.FunctionDef
    found = [node for node in tree.body if isinstance(node, kinds) and node.name == name]
    text = ast.get_docstring(found[0] if found else tree) or ""
    first = " ".join(text.partition("\n\n")[0].split())
    return re.split(r"(?<=\.) (?=[A-Z])", first)[0].replace("|", "\\|")


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
        entries = [{".".join(room.relative_to(ROOT).parts[1:]): name_page(room)} for room in rooms]
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


FORMULA = re.compile(r"\\\((.+?)\\\)|\\\[(.+?)\\\]|\$\$(.+?)\$\$", re.S)
FORMULA_OF_NOTEBOOK = re.compile(r"\$\$(.+?)\$\$|\$([^$\n]+)\$", re.S)
PLAIN = LatexNodes2Text(math_mode="text")


def write_plainly(found: re.Match) -> str:
    """A formula in plain signs, as a hit of the search shows it: `k a_0` for `\\(k\\,a_0\\)`."""
    tex = next(filter(None, found.groups()))
    return " ".join(PLAIN.latex_to_text(tex.replace("&amp;", " ")).split())


def clean_entry(location: str, text: str) -> str:
    """The text of a page or section as the search needs it: plain formulas, no source code."""
    if location.startswith("reference/"):
        text = text.partition("Source code in <code>")[0]
    formulas = FORMULA_OF_NOTEBOOK if location.startswith("notebooks/") else FORMULA
    return formulas.sub(write_plainly, text)


def on_post_build(config):
    """Rewrite the index of the search; see `clean_entry`."""
    path = Path(config.site_dir, "search", "search_index.json")
    index = json.loads(path.read_text(encoding="utf-8"))
    for entry in index["docs"]:
        for part in ("title", "text"):
            entry[part] = clean_entry(entry["location"], entry[part])
    path.write_text(json.dumps(index, ensure_ascii=False), encoding="utf-8")
