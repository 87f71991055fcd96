"""What differs on Windows: no fcntl, no resource, no SIGUSR1; files that are open stay."""

from __future__ import annotations

import os
import subprocess
import sys
import types

import pytest

from builders import ROOT
from regrid.errors import BadInput
from runs.bench import child_time
from runs.store import directory, files, locking
from runs.store.directory import RunDirectory

PACKAGES = ("regrid", "hydro", "problems", "runs", "shockgrid")
# before anything of ours is imported: what Windows has not got
STRIPPED = """
import os, signal, sys
for name in ("fcntl", "grp", "pwd", "resource", "termios"):
    sys.modules[name] = None
for name in ("SIGUSR1", "SIGUSR2", "SIGHUP", "SIGKILL", "SIGALRM", "setitimer"):
    delattr(signal, name)
for name in ("fork", "getuid", "geteuid", "sched_getaffinity", "sysconf", "sync", "mkfifo"):
    delattr(os, name)
"""


class Locks(types.SimpleNamespace):
    """The part of msvcrt that locks a byte of a file, for one process."""

    LK_NBLCK = 2

    def locking(self, descriptor: int, mode: int, size: int) -> None:
        assert (mode, size) == (self.LK_NBLCK, 1)
        number = os.fstat(descriptor).st_ino
        if number in self.held:
            raise PermissionError(13, "Permission denied")
        self.held.add(number)


@pytest.fixture
def windows(monkeypatch):
    """Locks as Windows has them."""
    locks = Locks(held=set())
    monkeypatch.setattr(locking, "fcntl", None)
    monkeypatch.setattr(locking, "msvcrt", locks)
    monkeypatch.setattr(directory, "KEEPS_OPEN_FILES", True)
    return locks


def test_every_module_is_imported_without_the_modules_of_unix():
    names = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        if path.name != "__main__.py"
    ]
    script = (
        f"{STRIPPED}\nimport importlib\nfor name in {names!r}:\n    importlib.import_module(name)"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]


def test_a_run_a_restart_and_a_picture_without_them(tmp_path):
    script = f"""{STRIPPED}
sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / "tests" / "io")!r}]
from problems.registry import PROBLEMS
from runs.cli.main import main
PROBLEMS["toy"] = "toy_problem:Toy"
for words in ("run toy -o a --set run.max_steps=20", "restart a --set run.max_steps=40",
              "plot a", "info a"):
    code = main(words.split())
    assert code == 0, (words, code)
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert not (tmp_path / "a" / ".running").exists()


def test_a_directory_is_held_by_one_alone(windows, tmp_path):
    run = RunDirectory(tmp_path)
    with run.claimed():
        with pytest.raises(BadInput, match="in use"), RunDirectory(tmp_path).claimed():
            pass
        assert len(windows.held) == 1
    windows.held.clear()  # Windows does that when the file is closed
    with run.claimed():
        assert run.lock.exists()
    assert not run.lock.exists()


def test_a_lock_that_cannot_be_removed_while_open_goes_afterwards(windows, tmp_path, monkeypatch):
    run = RunDirectory(tmp_path)
    opened = []
    real_open, real_unlink = open, type(run.lock).unlink

    def watch(*words, **options):
        opened.append(real_open(*words, **options))
        return opened[-1]

    def refuse_open_files(path, missing_ok=False):
        if any(not file.closed for file in opened):
            raise PermissionError(13, "in use by another process")
        real_unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(directory, "open", watch, raising=False)
    monkeypatch.setattr(type(run.lock), "unlink", refuse_open_files)
    with run.claimed():
        assert run.lock.exists()
    assert opened and not run.lock.exists()


def test_a_file_that_a_reader_has_open_is_replaced_when_it_is_closed(tmp_path, monkeypatch):
    real, calls = os.replace, []

    def busy_twice(source, target):
        calls.append(target)
        if len(calls) < 3:
            error = PermissionError(13, "in use by another process")
            error.winerror = 32
            raise error
        real(source, target)

    monkeypatch.setattr(files, "PAUSE", 0.0)
    monkeypatch.setattr(os, "replace", busy_twice)
    files.write_atomically(tmp_path / "run.xmf", "new")
    assert (tmp_path / "run.xmf").read_text(encoding="utf-8") == "new"
    assert len(calls) == 3


def test_a_refused_replacement_is_one_sentence_and_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "run.xmf"
    files.write_atomically(path, "old")
    calls = []

    def refuse(source, target):
        calls.append(target)
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(BadInput, match=r"no permission for .*run\.xmf"):
        files.write_atomically(path, "new")
    assert len(calls) == 1  # only Windows is worth a second try
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.xmf"]
    assert path.read_text(encoding="utf-8") == "old"


def test_cpu_time_of_commands_is_refused_where_nobody_counts_it(monkeypatch):
    assert child_time.read_child_time().user >= 0.0
    monkeypatch.setattr(child_time, "resource", None)
    with pytest.raises(BadInput, match="--runs none"):
        child_time.read_child_time()


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "cp437"])
def test_names_that_a_terminal_cannot_show_end_no_command(encoding, tmp_path):
    (tmp_path / "жλ.toml").write_text('problem = "riemann"\ncells = 16\n', encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "shockgrid", "check", str(tmp_path / "жλ.toml")],
        cwd=ROOT,
        env={**os.environ, "PYTHONUTF8": "0", "PYTHONIOENCODING": encoding},
        capture_output=True,
    )
    assert done.returncode == 0, done.stderr
    assert b"cells = 16" in done.stdout
