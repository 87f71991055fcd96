"""From a name or a TOML file and some `--set key=value` to a checked deck.

The deck of a run is, in this order of strength: `--set`, the deck file, the defaults of the
problem's Deck.  Each error in it is reported in a sentence that names the key, the place, what
was given and what would be right.
"""

from __future__ import annotations

import contextlib
import re
import shlex
import tomllib
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import tomli_w

from shockgrid.problems.deck import DIGESTS, Deck, DeckTable, check_digests, place_gauges
from shockgrid.problems.problem_file import (
    ProblemFile,
    describe_mistake,
    find_problem_file,
    is_problem_file,
    read_problem_file,
)
from shockgrid.problems.registry import PROBLEMS, is_problem, load_problem
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.text_files import DEEPEST_NESTING, TooMuch, cut, load_toml, read_text
from shockgrid.runs.deck.checking import check_deck, wants_text

PLAIN_KEY = re.compile(r"\w+(\.\w+)*")  # as it stands in a setting
DECKS = Path(__file__).resolve().parent / "packaged"


@dataclass(frozen=True)
class ReadDeck:
    """A checked deck: the problem's name, the typed deck, where it is from, each --set over it.

    file: the file that the problem is in, where it is none of the packages'.
    """

    problem: str
    deck: Deck
    origin: str
    settings: tuple[str, ...] = ()
    file: ProblemFile | None = None

    @property
    def label(self) -> str:
        """The problem's name for folders: that of a file without its ending."""
        return self.file.path.stem if self.file else self.problem

    def make_problem(self):
        """The problem for this deck; raises BadInput for what the deck's fields say together, and
        for a file that is no longer the one that the deck has the digest of."""
        check_digests(self.deck.digests)
        with self.numbers_in_reach(always=True):
            place_gauges(self.deck.gauge)
            return (self.file.problem if self.file else load_problem(self.problem))(self.deck)

    @property
    def described(self) -> str:
        """Where the deck came from, and every --set over it: `FILE with --set mach=2`."""
        options = " ".join(f"--set {shlex.quote(setting)}" for setting in self.settings)
        return f"{self.origin} with {options}" if options else self.origin

    @property
    def given_in(self) -> str:
        """Words for where a number that is wrong may stand."""
        return self.origin + " and --set" * bool(self.settings)

    @contextlib.contextmanager
    def numbers_in_reach(self, always: bool = False):
        """Turn an overflow or a division by zero met in the block into BadInput about the deck.

        BadInput about `deck:` (or `always`) that comes from the block says where the deck is from;
        a division by zero in a problem's own file, its line.
        """
        try:
            yield
        except BadInput as error:
            lines = str(error).splitlines()
            if not (always or any(line.startswith("deck: ") for line in lines)):
                raise
            lines = [f"{self.given_in}: {line.removeprefix('deck: ')}" for line in lines]
            raise BadInput("\n".join(lines)) from error
        except ArithmeticError as error:
            if mistake := describe_mistake(error):
                raise BadInput(mistake) from error
            raise BadInput(
                f"{self.given_in}: a number is too large or too small to compute with"
                f" ({error.args[-1]})"
            ) from error

    def to_toml(self) -> str:
        """The resolved deck: every key with its value, readable by `shockgrid run` again."""
        return to_toml(self.problem, self.deck)


def packaged_decks() -> dict[str, Path]:
    """The decks that come with shockgrid, by name."""
    return {path.stem: path for path in sorted(DECKS.glob("*.toml"))}


def read_deck(source: str, settings: tuple[str, ...] = ()) -> ReadDeck:
    """Find deck `source` (a file, a packaged deck or a problem), apply `settings`, check it."""
    table, origin = find_deck(source)
    return resolve_deck(table, origin, settings)


def find_deck(source: str) -> tuple[dict[str, Any], str]:
    """The raw table of a deck, and words for where it is from."""
    path = Path(source)
    if path.is_dir() and source not in PROBLEMS:
        deck, folder = (shlex.quote(str(one)) for one in (path / "deck.toml", path))
        if not (path / "deck.toml").is_file():
            raise BadInput(f"{source} is a folder; give a problem, a packaged deck or a deck file")
        raise BadInput(
            f"{source} is the folder of a run; its deck is {deck}, and to continue the run type "
            f"shockgrid restart {folder}"
        )
    if source in packaged_decks():
        path = packaged_decks()[source]
        return read_toml(path), f"deck {path.name}"
    if source in PROBLEMS or is_problem_file(source):
        return {"problem": source}, f"the defaults of {source}"
    if path.suffix == ".toml" or path.exists() or len(path.parts) > 1:
        return read_toml(path), str(path)
    raise BadInput(f"there is no problem or deck {source!r}{suggest_deck(source)}")


def suggest_deck(name: str, known: Sequence[str] = ()) -> str:
    """As `suggest`, but names that contain `name` (such as 'mushroom') come first."""
    known = known or list(dict.fromkeys([*PROBLEMS, *packaged_decks()]))
    longer = sorted((other for other in known if len(name) > 2 and name in other), key=len)
    if not longer:
        return suggest(name, known)
    shown = " or ".join(repr(other) for other in longer[:3])
    return f"; did you mean {shown}{', ...' * (len(longer) > 3)}?"


def read_toml(path: Path) -> dict[str, Any]:
    """The table in a TOML file; BadInput with the place of a mistake."""
    try:
        return load_toml(read_text(path))
    except FileNotFoundError:
        raise BadInput(f"{path} does not exist") from None
    except OSError as error:
        raise BadInput(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise BadInput(f"{path} is not a text file in UTF-8 (byte {error.start})") from error
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path} is not valid TOML: {error}") from error


def resolve_deck(
    table: dict[str, Any],
    origin: str,
    settings: tuple[str, ...] = (),
    file: ProblemFile | None = None,
) -> ReadDeck:
    """Check a raw table with `settings` laid over it and make the typed deck.

    file: that of the problem, where it is known already; else a Python file that the deck names is
    looked for from here, then beside the deck.
    """
    named = [s.partition("=")[2] for s in settings if s.partition("=")[0].strip() == "problem"]
    problem = parse_value(named[-1]) if named else table.get("problem")
    if problem is None:
        raise BadInput(f'{origin}: a deck starts with problem = "name"{suggest("", PROBLEMS)}')
    if not isinstance(problem, str):
        raise BadInput(f"{origin}: problem = {problem!r} is not a name; write it in quotes")
    if not is_problem(problem):
        raise BadInput(f"{origin}: there is no problem {problem!r}{suggest(problem, PROBLEMS)}")
    if file is None and is_problem_file(problem):
        file = read_problem_file(find_problem_file(problem, Path(origin).parent))
    kind = (file.problem if file else load_problem(problem)).Deck
    given = [apply_setting(table, setting, kind) for setting in settings]
    table.pop("problem", None)

    def where(key: str) -> str:
        ours = any(f"{key}.".startswith(f"{k}.") or k.startswith(f"{key}.") for k in given)
        return "--set" if ours else origin

    check_deck(table, kind, where)
    try:
        home = Path(origin).parent if Path(origin).is_file() else Path()  # of files a deck names
        if origin.startswith("deck ") and (DECKS / origin.removeprefix("deck ")).is_file():
            home = DECKS
        deck = msgspec.convert(merge_defaults(table, kind()), kind).find_files(home)
        return ReadDeck(problem, deck, origin, tuple(settings), file)
    except msgspec.ValidationError as error:  # a rule that check_deck does not know
        raise BadInput(f"{origin}: {error}") from error


def merge_defaults(table: dict[str, Any], default: DeckTable) -> dict[str, Any]:
    """`table` with the keys that it leaves out of a merging part taken from `default`."""
    merged = dict(table)
    for name in default.__struct_fields__:
        part = getattr(default, name)
        given = table.get(name)
        if isinstance(part, DeckTable) and isinstance(given, dict) and part.keeps_defaults(given):
            merged[name] = _drop_none(msgspec.to_builtins(part)) | merge_defaults(table[name], part)
    return merged


def apply_setting(table: dict[str, Any], setting: str, kind: type[Deck] | None = None) -> str:
    """Lay `a.b=value` over a raw table; return the dotted key.

    kind: that of the deck.  Where the table lacks a list of which an entry is set, as in
    modes.0.ka0=1, it gets the default one; where a field wants text it gets it as written:
    case=123 names a case.
    """
    key, equals, text = setting.partition("=")
    key, names = key.strip(), key.strip().split(".")
    if not equals or not all(names):
        if PLAIN_KEY.fullmatch(setting):
            raise BadInput(f"--set {setting}: its value is missing; write --set {setting}=VALUE")
        raise BadInput(f"--set {setting!r}: the form is key=value, such as run.t_end=1e-3")
    if len(names) - 1 > DEEPEST_NESTING:
        raise BadInput(f"--set {cut(key)}: a key of {len(names)} names is in no deck")
    branch: Any = table
    listed = kind is not None and any(name.isdigit() for name in names[1:])
    default: Any = _drop_none(msgspec.to_builtins(kind())) if kind and listed else {}
    for depth, (name, following) in enumerate(pairwise(names), start=1):
        if isinstance(branch, list):
            branch = _list_entry(branch, name, key)
            default = None
        else:
            default = default.get(name) if isinstance(default, dict) else None
            is_list = following.isdigit() and isinstance(default, list)
            branch = branch.setdefault(name, deepcopy(default) if is_list else {})
        if not isinstance(branch, dict | list):
            raise BadInput(f"--set {key}: {'.'.join(names[:depth])} is a value, not a table")
    value = parse_value(text)
    if kind and isinstance(value, bool | int | float) and wants_text(kind, names, value):
        value = text.strip()
    if isinstance(branch, list):
        _list_entry(branch, names[-1], key)
        branch[int(names[-1])] = value
    else:
        branch[names[-1]] = value
    return key


def _list_entry(entries: list, name: str, key: str) -> Any:
    if not name.isdigit() or int(name) >= len(entries):
        raise BadInput(f"--set {key}: {name} is not an index (from 0) of a list of {len(entries)}")
    return entries[int(name)]


def parse_value(text: str) -> Any:
    """A TOML value, or the text itself where it is none (so that words need no quotes)."""
    try:
        table = load_toml(f"value = {text}")
    except TooMuch as error:
        raise BadInput(f"--set: {cut(text.strip())} is not a value: {error}") from error
    except tomllib.TOMLDecodeError as error:
        if text.strip()[:1] in ("[", "{"):
            raise BadInput(f"--set: {cut(text.strip())} is not valid TOML: {error}") from error
        return text.strip()
    return table["value"] if set(table) == {"value"} else text.strip()


def to_toml(problem: str, deck: Deck) -> str:
    """A deck as TOML; keys without a value (None) are left out, as TOML has no word for them."""
    table = _drop_none(msgspec.to_builtins(deck))
    if not deck.digests:
        del table[DIGESTS]
    return tomli_w.dumps({"problem": problem, **table})


def _drop_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _drop_none(entry) for key, entry in value.items() if entry is not None}
    if isinstance(value, list | tuple):
        return [_drop_none(entry) for entry in value]
    return value
