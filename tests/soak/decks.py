"""Decks changed at random: `check` answers with the deck or a sentence; some accepted ones run."""

from __future__ import annotations

import random
import re
from pathlib import Path

from shockgrid.problems.registry import PROBLEMS
from shockgrid.runs.deck.reading import packaged_decks, read_deck
from shockgrid.runs.inspection.account import describe_cautions
from shockgrid.runs.march.launching import check_regridder
from soak.child import call
from soak.trial import Outcome, find_fault, make_random

ODD_VALUES = (
    "0", "-0.0", "-1", "1", "1e308", "-1e308", "1e-320", "inf", "-inf", "nan",
    "9223372036854775807",
    "-9223372036854775808", "18446744073709551616", "1" + "0" * 400, "1e400", "true", '""', '"x"',
    "[]", "{}", "[[]]", "[1]", "[1, 2]", "[0, 0]", "[1e9, 1e9]", "[{}]", "{a = 1}", "1979-05-27",
    "07:32:00", "0x7fffffff", '"\\u0000"', '"\\u001b]0;x\\u0007"', '"\\u202e\\u0007"',
    '"é\U0001f4a5"',
    '"../../etc"', '"/"', '"."', '"%s%n{0}"', '"' + "x" * 5000 + '"', "'''\n\n'''",
    "[" * 200 + "]" * 200,
)  # fmt: skip
ODD_KEYS = (
    "",
    '""',
    "run",
    '"\\u001b[2J"',
    "__class__",
    "a.b.c",
    '"é"',
    "kind",
    "problem",
    "x" * 300,
)
ODD_CHARACTERS = "\x00\x07\x1b\x7f\x9b\u202e\u2028\ufeff\U0001f4a5\"'[]{}=#\n"
PAIR = re.compile(r"^(?P<key>[^=\n\[#]+?)(?P<equals>\s*=\s*)(?P<value>.+)$", re.MULTILINE)
TABLE = re.compile(r"^\[+.*\]+$", re.MULTILINE)
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")


def write_base(chance: random.Random) -> str:
    """A packaged deck as it is, or with every key resolved, or that of a problem's defaults."""
    packaged = packaged_decks()
    name = chance.choice([*packaged, *PROBLEMS])
    if name in packaged and chance.random() < 0.3:
        return packaged[name].read_text(encoding="utf-8")
    return read_deck(name).to_toml()


def change_value(text: str, chance: random.Random) -> str:
    """One value another one of any type."""
    return _replace(text, chance, "value", chance.choice(ODD_VALUES))


def change_number(text: str, chance: random.Random) -> str:
    """One number times a factor, or its sign turned, or a little beside a whole one."""
    found = list(NUMBER.finditer(text))
    if not found:
        return text
    match = chance.choice(found)
    value = float(match[0])
    factor = chance.choice((-1.0, 0.0, 0.5, 2.0, 1.0 + 1e-15, 10.0, 1e3, 1e-3, 1e12, 1e-12))
    other = value * factor + chance.choice((0.0, 0.0, 1.0, -1.0))
    whole = match[0].lstrip("-").isdigit() and abs(other) < 1e15 and chance.random() < 0.9
    return text[: match.start()] + repr(int(other) if whole else other) + text[match.end() :]


def misspell_key(text: str, chance: random.Random) -> str:
    """One key with a letter less, more or another, or quite another key."""
    found = list(PAIR.finditer(text))
    if not found:
        return text
    key = chance.choice(found)["key"].strip()
    place = chance.randrange(max(1, len(key)))  # an earlier change may have emptied it
    other = chance.choice(
        (key[:place] + key[place + 1 :], key[:place] + "x" + key[place:], key.upper(), key[::-1])
    )
    return _replace(text, chance, "key", chance.choice((other, other, *ODD_KEYS)))


def repeat_line(text: str, chance: random.Random) -> str:
    """One line twice, elsewhere, or left out."""
    lines = text.splitlines()
    line = lines.pop(chance.randrange(len(lines)))
    for _ in range(chance.choice((0, 1, 2))):
        lines.insert(chance.randint(0, len(lines)), line)
    return "\n".join(lines) + "\n"


def nest(text: str, chance: random.Random) -> str:
    """Keys pushed below another table, deep arrays and deep tables."""
    depth = chance.choice((2, 20, 300, 3000))
    return chance.choice(
        (
            lambda: "[a]\n" + text,
            lambda: text + "\n[" + ".".join(["a"] * depth) + "]\nb = 1\n",
            lambda: _replace(text, chance, "value", "[" * depth + "]" * depth),
            lambda: _replace(text, chance, "value", "{a = " * depth + "1" + "}" * depth),
            lambda: text + "\n" + "[[run]]\n" * 3,
        )
    )()


def swap_tables(text: str, chance: random.Random) -> str:
    """The heads of two tables changed for one another, or one made a list of tables."""
    found = TABLE.findall(text)
    if not found:
        return nest(text, chance)
    one = chance.choice(found)
    other = chance.choice(found)
    if one == other:
        return text.replace(one, f"[{one}]")
    return text.replace(one, "\0").replace(other, one).replace("\0", other)


def cut(text: str, chance: random.Random) -> str:
    """The file ends early."""
    return text[: chance.randrange(len(text))]


def spoil_characters(text: str, chance: random.Random) -> str:
    """A few odd characters put in anywhere."""
    for _ in range(chance.choice((1, 1, 3, 30))):
        place = chance.randint(0, len(text))
        text = text[:place] + chance.choice(ODD_CHARACTERS) + text[place:]
    return text


def _replace(text: str, chance: random.Random, part: str, new: str) -> str:
    found = list(PAIR.finditer(text))
    if not found:
        return text + f"\nx = {new}\n"
    match = chance.choice(found)
    return text[: match.start(part)] + new + text[match.end(part) :]


CHANGES = (
    change_value, change_value, change_number, change_number, change_number, misspell_key,
    repeat_line, nest, swap_tables, cut, spoil_characters,
)  # fmt: skip


def make_deck(chance: random.Random) -> bytes:
    """The bytes of a changed deck; some are no text at all."""
    text = write_base(chance)
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        text = chance.choice(CHANGES)(text or "\n", chance)
    content = text.encode("utf-8", "surrogatepass")
    if chance.random() < 0.04:
        place = chance.randrange(len(content) + 1)
        content = content[:place] + chance.randbytes(chance.choice((1, 3, 100))) + content[place:]
    return content


class Decks:
    """`check` of a changed deck."""

    name = "decks"
    wanted = 10_000
    weight = 3.0
    about = "a packaged deck changed at random, `check`ed"
    cpu = 20  # [s] for one check

    def __init__(self, seed: int):
        self.seed = seed

    def prepare(self) -> None:
        """Import what the checks of all problems need."""
        for name in PROBLEMS:
            problem = read_deck(name).make_problem()
            check_regridder(problem)
            describe_cautions(problem)

    def attempt(self, number: int, folder: Path) -> Outcome:
        deck = folder / "deck.toml"
        deck.write_bytes(make_deck(make_random("decks", self.seed, number)))
        done = call(["check", str(deck)], folder, cpu=self.cpu, memory=4)
        if fault := find_fault(done, (0, 2)):
            return fault
        if done.code == 2 and "not enough memory" in done.err:
            return Outcome("out of memory", True, "the size was not seen beforehand")
        return Outcome("refused with a message" if done.code else "accepted")


class DeckRuns(Decks):
    """A short run of a changed deck that `check` accepts: twenty steps or an end with a name."""

    name = "deck-runs"
    wanted = 500
    weight = 2.0
    about = "a changed deck that `check` accepts, run for 20 steps"

    def attempt(self, number: int, folder: Path) -> Outcome:
        chance = make_random(self.name, self.seed, number)
        deck = folder / "deck.toml"
        path = folder / "run"
        for _ in range(200):
            deck.write_bytes(make_deck(chance))
            done = call(["check", str(deck)], folder, cpu=self.cpu, memory=4)
            if done.code == 0:
                break
        bounds = ["--set", "run.max_steps=20", "--set", "run.threads=1", "--max-wall", "15s"]
        done = call(["run", str(deck), "-q", "-o", str(path), *bounds], folder, cpu=60, memory=6)
        if fault := find_fault(done):
            return fault
        if done.code == 2 and not path.exists():
            return Outcome("accepted by check, refused by run", False, done.err.strip()[:300])
        return Outcome({0: "ran", 2: "refused late", 3: "ended with a message"}[done.code])
