"""Citations, links and paths in docstrings and pages lead somewhere.

Forms: a formula or section of docs/theory is cited as "theory R1.3" or "theory F4", a paper by its
key in square brackets, as docs/bibliography.md lists it.  Nothing else is a citation.
"""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path

import pytest

from builders import ROOT
from shockgrid.hydro.step import SIDE_PASSES

DOCS = ROOT / "docs"
PACKAGES = ("regrid", "hydro", "problems", "runs", "shockgrid")
FOLDERS = (*PACKAGES, "tests", "benchmarks")
SOURCES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
PAGES = sorted([*DOCS.rglob("*.md"), *ROOT.glob("*.md")])
HERE = Path(__file__).resolve()

NUMBER = r"[RF]\d{1,2}(?:\.\d{1,2})?"
LABEL = re.compile(r"\\text\{\((" + NUMBER + r")\)\}")
SECTION = re.compile(r"^#+ (" + NUMBER + r") ", re.MULTILINE)
CITED = re.compile(r"\b[Tt]heory\s+(" + NUMBER + r"(?:(?:,| and| to)\s+" + NUMBER + r")*)")
BARE = re.compile(r"(?<![\w\\.])" + NUMBER + r"(?![\w-])")
KEY = r"[A-Z][A-Za-z]*[a-z](?:(?:18|19|20)\d\d[a-z]?|N[D])"
KEY_CITED = re.compile(r"\[(" + KEY + r")\]")
KEY_LISTED = re.compile(r"^\| \[(" + KEY + r")\]", re.MULTILINE)
LINK = re.compile(r"!?\[[^\]]*\]\(([^()\s]+)(?:\s+\"[^\"]*\")?\)")
FENCE = re.compile(r"^(```|~~~).*?^\1", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"`([^`\n]+)`")
FILE_NAMED = re.compile(r"(?:" + "|".join((*FOLDERS, "docs")) + r")/[\w./*-]+")
CODE_NAMED = re.compile(r"`([A-Za-z_][\w.]*)(?:\(.*?\))?`")
ENDINGS = "toml", "csv", "py", "md", "history"  # of files
MODULE_NAMED = re.compile(r"(?:" + "|".join(PACKAGES) + r")(?:\.\w+)+")
LEAST_CITATIONS = 60  # of formulas and sections, in the code: fewer, and the pattern is broken


def read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def theory_labels() -> list[str]:
    """All numbers that can be cited, as often as they are defined."""
    return [
        found
        for page in sorted((DOCS / "theory").glob("*.md"))
        for pattern in (LABEL, SECTION)
        for found in pattern.findall(read(page))
    ]


def cited_numbers(text: str) -> list[str]:
    return [number for group in CITED.findall(text) for number in re.findall(NUMBER, group)]


def cited_keys(text: str) -> list[str]:
    return KEY_CITED.findall(text)


def slugs(text: str) -> tuple[set[str], set[str]]:
    """Anchors of a page's headings: as a forge makes them, and as Python-Markdown does."""
    forge: set[str] = set()
    site: set[str] = set()
    for heading in re.findall(r"^#{1,6} +(.+?) *#*$", FENCE.sub("", text), re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
        plain = re.sub(r"(?<!\w)[*_]+|[*_]+(?!\w)", "", plain)
        forge.add(_first_free(re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-"), forge, "-"))
        ascii_only = unicodedata.normalize("NFKD", plain).encode("ascii", "ignore").decode()
        words = re.sub(r"[^\w\s-]", "", ascii_only).strip().lower()
        site.add(_first_free(re.sub(r"[-\s]+", "-", words), site, "_"))
    return forge, site


def _first_free(slug: str, taken: set[str], joint: str) -> str:
    number = 0
    free = slug
    while free in taken:
        number += 1
        free = f"{slug}{joint}{number}"
    return free


def broken_links(page: Path, text: str) -> list[str]:
    """Relative links and pictures of a page whose file or anchor does not exist."""
    broken = []
    for target in LINK.findall(SPAN.sub("", FENCE.sub("", text))):
        if re.match(r"[a-z]+:", target):
            continue
        place, _, anchor = target.partition("#")
        file = (page.parent / place).resolve() if place else page
        if not file.exists():
            broken.append(f"{name(page)}: {target}: no such file")
        elif anchor and file.suffix == ".md":
            forge, site = slugs(text if file == page else read(file))
            if anchor not in forge or anchor not in site:
                broken.append(f"{name(page)}: {target}: no such heading")
    return broken


def is_there(named: str) -> bool:
    """Whether a file, a pattern of files or a dotted name of this repository exists."""
    if "/" in named:
        return any(ROOT.glob(named.rstrip("/.")))
    parts = named.split(".")
    if parts[0] == "shockgrid" and parts[1] in PACKAGES:
        parts = parts[1:]
    for length in range(len(parts), 0, -1):
        path = ROOT.joinpath(*parts[:length])
        for file in (path.with_suffix(".py"), path / "__init__.py"):
            if file.is_file() and all(
                re.search(rf"\b{re.escape(part)}\b", read(file)) for part in parts[length:]
            ):
                return True
    return is_deck_option(parts)


def is_deck_option(parts: list[str]) -> bool:
    """Whether these are the deck's table `regrid` and a key of it, which look like a module."""
    key = re.compile(rf"^class Regrid\(.*?^    {re.escape(parts[-1])}: ", re.MULTILINE | re.DOTALL)
    return parts[0] == "regrid" and any(
        key.search(read(path)) for path in (ROOT / "problems").rglob("*.py")
    )


def missing_files(text: str) -> list[str]:
    """Files and modules named in backticks that do not exist."""
    missing = []
    for span in SPAN.findall(FENCE.sub("", text)):
        for pattern in (FILE_NAMED, MODULE_NAMED):
            found = pattern.fullmatch(span.split(":")[0])
            if found and not is_there(found[0]):
                missing.append(found[0])
    return missing


def test_every_number_is_defined_once_and_in_order():
    labels = theory_labels()
    assert len(labels) == len(set(labels)), sorted(k for k in set(labels) if labels.count(k) > 1)
    sections = {label for label in labels if "." not in label}
    for letter in "RF":
        numbers = sorted(int(label[1:]) for label in sections if label[0] == letter)
        assert numbers == list(range(1, len(numbers) + 1)) and len(numbers) > 5
    for section in sections:
        formulas = [int(label.split(".")[1]) for label in labels if label.startswith(section + ".")]
        assert formulas == list(range(1, len(formulas) + 1)), section


def test_every_theory_number_cited_is_defined():
    labels = set(theory_labels())
    count = 0
    for path in [*SOURCES, *PAGES]:
        if path == HERE:
            continue
        numbers = cited_numbers(read(path))
        count += len(numbers) if path.suffix == ".py" else 0
        assert set(numbers) <= labels, f"{name(path)}: {sorted(set(numbers) - labels)}"
    assert count >= LEAST_CITATIONS
    for page in (DOCS / "theory").glob("*.md"):
        numbers = set(BARE.findall(SPAN.sub("", read(page))))
        assert numbers <= labels, f"{name(page)}: {sorted(numbers - labels)}"


def test_every_bibliography_key_cited_is_listed():
    listed = KEY_LISTED.findall(read(DOCS / "bibliography.md"))
    assert len(listed) == len(set(listed)) > 50
    for path in [*SOURCES, *PAGES]:
        if path == HERE:
            continue
        keys = set(cited_keys(read(path)))
        assert keys <= set(listed), f"{name(path)}: {sorted(keys - set(listed))}"


def test_links_and_pictures_of_pages_resolve():
    found = [broken for page in PAGES for broken in broken_links(page, read(page))]
    assert not found, "\n".join(found)


def test_files_and_modules_named_in_pages_exist():
    found = [f"{name(page)}: {file}" for page in PAGES for file in missing_files(read(page))]
    assert not found, "\n".join(found)


def test_names_on_the_theory_pages_are_those_of_the_code():
    words = set(re.findall(r"\w+", " ".join(read(path) for path in SOURCES if path != HERE)))
    for page in (DOCS / "theory").glob("*.md"):
        named = {span for span in SPAN.findall(read(page)) if re.fullmatch(r"[A-Za-z]\w*", span)}
        assert named <= words, f"{name(page)}: {sorted(named - words)}"


@pytest.mark.parametrize("page", ["architecture.md", "extending.md"])
def test_names_on_pages_about_code_are_those_of_the_code(page):
    text = read(DOCS / page)
    code = " ".join(read(path) for path in SOURCES if path.relative_to(ROOT).parts[0] in PACKAGES)
    own = " ".join(found[0] for found in FENCE.finditer(text))  # of the page's examples
    names = {name for name in CODE_NAMED.findall(FENCE.sub("", text)) if {*name} & {*"_."}}
    names |= {name for name in CODE_NAMED.findall(text) if re.match(r"[A-Z]\w+[a-z]$", name)}
    assert len(names) >= 5
    known = {*re.findall(r"\w+", code + own), *ENDINGS, ""}
    assert not {name for name in names if not {*name.split(".")} <= known}


def test_passes_stand_in_the_page_in_their_order():
    names = [move.__name__ for move, _, _ in SIDE_PASSES]
    text = read(DOCS / "architecture.md")
    told = CODE_NAMED.findall(text[text.index("| pass |") :])
    assert [name for name in told if name in names] == names
    assert all(reason for _, _, reason in SIDE_PASSES)
