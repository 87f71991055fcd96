"""Two commands at once in one directory, and clocks that jump: the bits of the undisturbed run."""

from __future__ import annotations

import random
import shutil
import time
from pathlib import Path

from shockgrid.runs.store.directory import RunDirectory
from soak.child import Call, call
from soak.kills import finish, has_deck
from soak.small_runs import SMALL, TrialsOfRuns, compare, find_other_files, list_words
from soak.trial import Outcome, find_fault, make_random, tell_last

REFUSALS = (
    "in use", "is not empty", "no restart point", "holds no run", "does not exist",
    "not a run directory", "has no dump", "no history", "no space", "nothing to",
)  # fmt: skip
PAIRS = (
    ("run", "run"), ("restart", "restart"), ("force", "force"), ("force", "restart"),
    ("restart", "info"), ("run", "info"), ("restart", "compare"), ("run", "plot"),
)  # fmt: skip


class Rivals(TrialsOfRuns):
    """Two commands begun within a moment of one another."""

    name = "rivals"
    wanted = 200
    weight = 1.0
    about = "two commands at once in one directory"

    def attempt(self, number: int, folder: Path) -> Outcome:
        chance = make_random(self.name, self.seed, number)
        problem = list(SMALL)[number % len(SMALL)]
        path = folder / "run"
        whole = self.undisturbed.find(problem)
        pair = PAIRS[number // len(SMALL) % len(PAIRS)]
        seconds = self.undisturbed.seconds[problem]
        if "restart" in pair or "force" in pair:
            Call(list_words(problem, path), folder).wait(
                kill_after=chance.uniform(0.3, 1) * seconds
            )
            if not has_deck(path):
                return Outcome("killed before there was a deck")
        words = {
            "run": list_words(problem, path),
            "force": list_words(problem, path, "--force"),
            "restart": ["restart", str(path), "-q"],
            "info": ["info", str(path)],
            "compare": ["compare", str(whole), str(path)],
            "plot": ["plot", str(path)],
        }
        first = Call(words[pair[0]], folder)
        looks = pair[1] in ("info", "compare", "plot")
        time.sleep(chance.choice((0.0, 0.001, 0.02, chance.random())) * seconds)
        other = call(words[pair[1]], folder)
        both = [first.wait(), other]
        for done in both:
            if fault := find_fault(done, (0, 1, 2) if done is other and looks else (0, 2)):
                return Outcome(fault.label, True, f"{' and '.join(pair)}: {fault.words}")
            if done.code == 2 and not any(word in done.err for word in REFUSALS):
                return Outcome("another message", True, f"{pair}: {tell_last(done)}")
        codes = tuple(done.code for done in both)
        if 0 not in codes and "restart" not in pair:
            return Outcome("neither went through", True, f"{pair}: {[tell_last(d) for d in both]}")
        outcome = finish(problem, path, whole, folder)
        if outcome.defect:
            return Outcome(outcome.label, True, f"{pair}, {codes}: {outcome.words}")
        what = "one waits" if looks else "one refused" if 2 in codes else "one after the other"
        return Outcome(f"{what}, bitwise equal")


class Clocks(TrialsOfRuns):
    """All clocks of a run, and of its restart, jump back and on by up to a day."""

    name = "clocks"
    wanted = 100
    weight = 0.7
    about = "clocks that jump back and on by up to a day during a run"

    def attempt(self, number: int, folder: Path) -> Outcome:
        chance = make_random(self.name, self.seed, number)
        problem = list(SMALL)[number % len(SMALL)]
        path = folder / "run"
        whole = self.undisturbed.find(problem)
        spoil = lambda: make_clocks_jump(chance.getrandbits(32))  # noqa: E731
        more = ("--max-wall", "1h") if chance.random() < 0.5 else ()
        done = call(list_words(problem, path, *more), folder, before=spoil)
        if fault := find_fault(done, (0,)):
            return fault
        log = RunDirectory(path).log.read_text(encoding="utf-8")
        stopped = "--max-wall 1h reached" in log and compare(whole, path).code
        if stopped:
            done = call(["restart", str(path), "-q"], folder, before=spoil)
            if fault := find_fault(done, (0,)):
                return fault
        compared = compare(whole, path)
        if compared.code:
            return Outcome("other bits", True, f"{problem}: {tell_last(compared)}")
        if other := find_other_files(whole, path):
            return Outcome("other bytes of files", True, f"{problem}: {', '.join(other[:4])}")
        shutil.rmtree(path)
        return Outcome("stopped early by --max-wall, bitwise equal" if stopped else "bitwise equal")


def make_clocks_jump(seed: int) -> None:
    """Let the clocks of this process jump, now and then, at most a day from the true time."""
    chance = random.Random(seed)
    day = 86400.0
    offset = 0.0

    def spoil(clock):
        def read():
            nonlocal offset
            if chance.random() < 0.1:
                offset = chance.choice((-1e-3, -1.0, -3600.0, -day, 0.0, 1.0, 3600.0, day))
            return clock() + offset

        return read

    for name in ("time", "monotonic", "perf_counter", "process_time"):
        setattr(time, name, spoil(getattr(time, name)))
