"""Packaged decks at half and double cells and at settings by chance within the schema's bounds."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path
from typing import Any

import msgspec

from shockgrid.runs.deck.checking import make_schema
from shockgrid.runs.deck.reading import packaged_decks, read_deck, read_toml
from soak.child import call
from soak.trial import Outcome, find_fault, make_random, tell_last

LEFT_ALONE = {"problem", "threads", "max_steps", "restart_every", "gauge", "output"}
CHANGED = 6  # trials a deck: half the cells, twice as many, four settings
COUNTS = ("cells", "ni", "nj", "intervals", "n")
SPREAD = 4.0  # a number without bounds is drawn up to so many times the default


class Settings:
    """A packaged deck changed within its bounds, run for some seconds."""

    name = "settings"
    weight = 2.0
    about = "a packaged deck at half and double cells and at random settings in bounds"
    seconds = 5

    def __init__(self, seed: int):
        self.seed = seed
        self.decks = list(packaged_decks())
        self.wanted = CHANGED * len(self.decks)
        self.order = list(range(self.wanted))  # of all sorts from the first trials on
        make_random(self.name, seed, -1).shuffle(self.order)

    def prepare(self) -> None:
        """Nothing is shared."""

    def attempt(self, number: int, folder: Path) -> Outcome:
        chance = make_random(self.name, self.seed, number)
        which, deck = divmod(self.order[number], len(self.decks))
        name = self.decks[deck]
        table = read_toml(packaged_decks()[name])
        schema = make_schema(table["problem"])
        if which < 2:
            resolved = msgspec.to_builtins(read_deck(name).deck)
            settings = change_cells(resolved, (0.5, 2.0)[which])
        else:
            settings = [draw_setting(schema, table, chance)]
        words = [w for text in (*settings, "run.threads=1") for w in ("--set", text)]
        limit = ["--max-wall", f"{self.seconds}s"]
        path = folder / "run"
        done = call(["run", name, "-q", "-o", str(path), *words, *limit], folder, cpu=60, memory=8)
        if fault := find_fault(done):
            return Outcome(fault.label, fault.defect, f"{name} {settings}: {fault.words}")
        if done.code == 2 and "not enough memory" in done.err:
            return Outcome("out of memory", True, f"{name} {settings}")
        if done.code == 2 and which < 2:
            return Outcome(
                "these cells are refused", False, f"{name} {settings}: {tell_last(done)}"
            )
        label = {0: "finished", 2: "refused with a message", 3: "ended with a message"}[done.code]
        if done.code == 0 and f"--max-wall {self.seconds}s reached" in done.out:
            label = "still running without trouble at the time limit"
        return Outcome(label, False, f"{name} {settings}: {tell_last(done)}")


def change_cells(part: Any, factor: float, key: str = "") -> list[str]:
    """Settings that multiply every number of cells in a deck, in its tables and lists too."""
    if isinstance(part, dict):
        inner = [(f"{key}.{name}".lstrip("."), value) for name, value in part.items()]
    elif isinstance(part, list | tuple):
        inner = [(f"{key}.{number}", value) for number, value in enumerate(part)]
    else:
        return []
    settings = []
    for path, value in inner:
        if path.rpartition(".")[2] not in COUNTS or isinstance(value, dict):
            settings += change_cells(value, factor, path)
        elif isinstance(value, list | tuple):
            settings.append(f"{path}={json.dumps([max(1, round(v * factor)) for v in value])}")
        elif value is not None:
            settings.append(f"{path}={max(1, round(value * factor))}")
    return settings


def draw_setting(schema: dict[str, Any], table: dict[str, Any], chance: random.Random) -> str:
    """A key of a deck, in its tables too, and a value within its bounds, as for `--set`."""
    keys = sorted(set(schema["properties"]) - LEFT_ALONE)
    path = []
    part = schema
    given = table
    while True:
        key = chance.choice(keys)
        path.append(key)
        part = _resolve(part["properties"][key], schema, chance)
        given = given.get(key) if isinstance(given, dict) else None
        inner = sorted(set(part.get("properties", ())) - LEFT_ALONE)
        if not inner or "enum" in part:
            break
        keys = [key for key in inner if "const" not in part["properties"][key]] or inner
    value = draw_value(part, given, schema, chance)
    return f"{'.'.join(path)}={value}"


def _resolve(part: dict[str, Any], schema: dict[str, Any], chance: random.Random) -> dict[str, Any]:
    while "$ref" in part or "anyOf" in part:
        if "$ref" in part:
            rest = {key: value for key, value in part.items() if key != "$ref"}
            part = schema["$defs"][part["$ref"].rpartition("/")[2]] | rest
        else:
            rest = {key: value for key, value in part.items() if key != "anyOf"}
            part = chance.choice(part["anyOf"]) | rest
    return part


def draw_value(part, given: Any, schema: dict[str, Any], chance: random.Random) -> str:
    """A value in the bounds of a part of a schema, in TOML's words."""
    part = _resolve(part, schema, chance)
    if "enum" in part:
        return json.dumps(chance.choice(part["enum"]))
    if "const" in part:
        return json.dumps(part["const"])
    default = given if isinstance(given, int | float) else part.get("default")
    match part.get("type"):
        case "boolean":
            return chance.choice(("true", "false"))
        case "integer" | "number":
            return _draw_number(part, default, chance)
        case "array":
            items = part.get("items", {})
            if isinstance(items, list):
                return f"[{', '.join(draw_value(item, None, schema, chance) for item in items)}]"
            count = chance.randint(part.get("minItems", 0), min(part.get("maxItems", 3), 5))
            return f"[{', '.join(draw_value(items, None, schema, chance) for _ in range(count))}]"
        case "object":
            needed = part.get("required", [])
            inner = part.get("properties", {})
            words = [f"{key} = {draw_value(inner[key], None, schema, chance)}" for key in needed]
            return f"{{{', '.join(words)}}}"
    return json.dumps(part.get("default", given if isinstance(given, str) else "x"))


def _draw_number(part: dict[str, Any], default: Any, chance: random.Random) -> str:
    whole = part["type"] == "integer"
    size = abs(default) if isinstance(default, int | float) and default else 1.0
    low = part.get("minimum", part.get("exclusiveMinimum", -SPREAD * size))
    high = part.get("maximum", part.get("exclusiveMaximum", max(low, 0.0) + SPREAD * size))
    if chance.random() < 0.15:  # a bound itself, where it is allowed
        value = chance.choice((part.get("minimum", high), part.get("maximum", high)))
    elif low >= 0 and high > 0 and chance.random() < 0.5:
        value = math.exp(chance.uniform(math.log(max(low, 1e-3 * size)), math.log(high)))
    else:
        value = chance.uniform(max(low, -10 * size), min(high, max(low, 0.0) + 10 * size))
    return repr(round(value) if whole else value)
