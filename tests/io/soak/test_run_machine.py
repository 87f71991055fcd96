"""Runs, kills, restarts and torn files in any sequence end in the bits of the undisturbed run."""

from __future__ import annotations

import shutil
import sys

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
    run_state_machine_as_test,
)

from benchmarks.soak import small_runs
from benchmarks.soak.child import call, import_commands
from benchmarks.soak.kills import finish, has_deck
from benchmarks.soak.small_runs import compare, list_words
from benchmarks.soak.trial import find_fault
from runs.store.directory import RunDirectory

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a system that forks")
MOMENTS = st.integers(1, 60)  # changes of files until a kill; a whole run makes about as many


def make_machine(folder, whole):
    """The machine whose run directory lies in `folder`; `whole` is the undisturbed run."""

    class RunMachine(RuleBasedStateMachine):
        """One run directory; `ended`: its last run or restart came to its end."""

        def say(self, *words, kill_at=None, allowed=(0,)):
            moment = (self.path, kill_at) if kill_at else None
            done = call(words, folder, kill_at=moment)
            assert done.killed or find_fault(done, allowed) is None, (words, done.code, done.err)
            return done

        @initialize(moment=MOMENTS | st.none())
        def begin(self, moment):
            self.path = folder / "run"
            shutil.rmtree(self.path, ignore_errors=True)
            self.ended = self.say(*list_words("toy", self.path), kill_at=moment).code == 0

        @rule(moment=MOMENTS | st.none())
        def run_anew(self, moment):
            words = list_words("toy", self.path, "--force")
            self.ended = self.say(*words, kill_at=moment, allowed=(0, 2)).code == 0

        @precondition(lambda self: has_deck(self.path))
        @rule(moment=MOMENTS | st.none())
        def restart(self, moment):
            done = self.say("restart", str(self.path), "-q", kill_at=moment, allowed=(0, 2))
            self.ended = done.code == 0

        @precondition(lambda self: has_deck(self.path))
        @rule()
        def ask(self):
            self.say("info", str(self.path), allowed=(0, 2))

        @precondition(lambda self: has_deck(self.path))
        @rule()
        def look_for_differences(self):
            code = self.say("compare", str(whole), str(self.path), allowed=(0, 1, 2)).code
            assert code == 0 or not self.ended

        @precondition(lambda self: has_deck(self.path))
        @rule(part=st.floats(0.0, 0.99))
        def tear_last_dump(self, part):
            points = RunDirectory(self.path).list_points()
            if points:
                content = points[-1][1].read_bytes()
                points[-1][1].write_bytes(content[: int(part * len(content))])
                self.ended = False

        @precondition(lambda self: (self.path / "history.csv").exists())
        @rule()
        def tear_last_row(self):
            with open(self.path / "history.csv", "a", encoding="utf-8") as file:
                file.write("31,0.17")

        def teardown(self):
            outcome = finish("toy", self.path, whole, folder)
            assert not outcome.defect, outcome

    return RunMachine


@pytest.mark.parametrize(
    ("examples", "steps"), [(5, 4), pytest.param(150, 12, marks=pytest.mark.slow)]
)
def test_any_sequence_ends_in_the_same_bits(tmp_path, monkeypatch, examples, steps):
    monkeypatch.setitem(small_runs.SMALL, "toy", ("run.t_end=0.1",))
    import_commands()
    whole = tmp_path / "whole"
    assert call(list_words("toy", whole), tmp_path).code == 0
    assert compare(whole, whole).code == 0
    chosen = settings(max_examples=examples, stateful_step_count=steps, deadline=None)
    run_state_machine_as_test(make_machine(tmp_path, whole), settings=chosen)
