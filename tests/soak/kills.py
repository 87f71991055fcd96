"""Runs killed at random moments, their restarts too: in the end the bits of the undisturbed run."""

from __future__ import annotations

import shutil
from pathlib import Path

from soak.child import Call, Done, call
from soak.small_runs import (
    SMALL,
    TrialsOfRuns,
    compare,
    find_left_overs,
    find_other_files,
    list_words,
)
from soak.trial import Outcome, find_fault, make_random, tell_last


class Kills(TrialsOfRuns):
    """Killed once to four times; half at a moment of time, half at a change of files."""

    name = "kills"
    wanted = 1000
    weight = 3.0
    about = "a run killed (its restarts too, up to three times), then restarted to its end"

    def attempt(self, number: int, folder: Path) -> Outcome:
        chance = make_random(self.name, self.seed, number)
        problem = list(SMALL)[number % len(SMALL)]
        whole = self.undisturbed.find(problem)
        path = folder / "run"
        words = list_words(problem, path)
        kills = chance.choice((1, 1, 2, 3, 4))
        killed = 0
        for _ in range(kills):
            done = self._kill(words, problem, path, folder, chance)
            if not done.killed:
                # a restart is refused where there is no restart point yet: see `finish`
                if fault := find_fault(done, (0, 2) if words[0] == "restart" else (0,)):
                    return fault
                break
            killed += 1
            if not has_deck(path):
                break
            words = ["restart", str(path), "-q"]
        outcome = finish(problem, path, whole, folder)
        if outcome.defect:
            return Outcome(outcome.label, True, f"{problem}, {killed} kills: {outcome.words}")
        if not killed:
            return Outcome("ended before the kill, bitwise equal")
        return outcome

    def _kill(self, words, problem, path, folder, chance) -> Done:
        if chance.random() < 0.5:
            changes = self.undisturbed.changes[problem]
            return Call(words, folder, kill_at=(path, chance.randint(1, changes))).wait()
        seconds = chance.uniform(0.0, self.undisturbed.seconds[problem])
        return Call(words, folder).wait(kill_after=seconds)


def has_deck(path: Path) -> bool:
    """Can a directory be restarted: is there a deck in it?"""
    return (path / "deck.toml").exists()


def finish(problem: str, path: Path, whole: Path, folder: Path) -> Outcome:
    """Restart what was broken off, or run it anew where there is nothing; compare with `whole`.

    The ways are those that a person is told: `restart`; where that is refused for want of a
    restart point, `run --force`.
    """
    label = "restarted, bitwise equal"
    if not path.exists():
        label = "killed before the first file, run again, bitwise equal"
        done = call(list_words(problem, path), folder)
    else:
        done = call(["restart", str(path), "-q"], folder)
        if done.code == 2:
            if fault := find_fault(done):
                return fault
            label = "no restart point yet, run again, bitwise equal"
            done = call(list_words(problem, path, "--force"), folder)
    if fault := find_fault(done, (0,)):
        return Outcome(f"cannot go on: {fault.label}", True, fault.words)
    compared = compare(whole, path)
    if compared.code:
        words = tell_last(compared)
        return Outcome("other bits", True, words)
    if other := find_other_files(whole, path):
        return Outcome("other bytes of files", True, ", ".join(other[:4]))
    if left := find_left_overs(path):
        return Outcome("parts of files left over", True, ", ".join(left[:4]))
    shutil.rmtree(path)
    return Outcome(label)
