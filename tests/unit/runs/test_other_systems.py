"""What differs on Windows: no fcntl, no resource, no SIGUSR1; files that are open stay."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from builders import ROOT
from regrid.errors import BadInput
from runs.store import files

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
