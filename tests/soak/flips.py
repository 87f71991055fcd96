"""One bit of a run's files turned: refused by name, harmless, or silent, which is a defect."""

from __future__ import annotations

import shutil
from pathlib import Path

from soak.child import call
from soak.small_runs import OFTEN, SMALL, load_kernels
from soak.trial import Outcome, find_fault, make_random, tell_last

FLIPPED = ("interface-instability", "riemann")
HALF = {"interface-instability": 10, "riemann": 20}
END = 1000
USES = ("restart",) * 10 + ("info",) * 3 + ("inspect",) * 2 + ("compare",) * 4 + ("plot",)
SAID = (
    "damaged",
    "skipped",
    "torn",
    "not valid TOML",
    "crc",
    "unreadable",
    "no readable",
    "differ",
)
TIMED = ("seconds_",)  # columns: wall times


class Flips:
    """A run stopped half-way, one bit turned in one file, then restarted or looked at."""

    name = "flips"
    wanted = 2000
    weight = 3.0
    about = "one bit turned in a dump, the history, the gauges or the deck of half a run"

    def __init__(self, seed: int, folder: Path):
        self.seed = seed
        self.folder = folder

    def prepare(self) -> None:
        self.folder.mkdir(exist_ok=True)
        for problem in FLIPPED:
            load_kernels(problem)
            half = self.folder / f"{problem}-half"
            whole = self.folder / f"{problem}-whole"
            settings = (*SMALL[problem], *OFTEN, f"run.max_steps={HALF[problem]}")
            words = [word for text in settings for word in ("--set", text)]
            done = call(["run", problem, "-q", "-o", str(half), *words], self.folder)
            if not done.code:
                shutil.copytree(half, whole)
                done = call(list_restart(whole), self.folder)
            if done.code:
                raise SystemExit(f"soak: {problem}: {done.err or done.out}")

    def attempt(self, number: int, folder: Path) -> Outcome:
        chance = make_random(self.name, self.seed, number)
        problem = chance.choice(FLIPPED)
        use = chance.choice(USES)
        half = self.folder / f"{problem}-half"
        run = folder / "run"
        shutil.copytree(half, run)
        dumps = sorted(run.glob("dumps/*.h5"))
        target = chance.choice(
            (*dumps, dumps[-1], dumps[-1], run / "history.csv", run / "deck.toml")
        )
        content = bytearray(target.read_bytes())
        place = chance.randrange(len(content))
        bit = chance.randrange(8)
        content[place] ^= 1 << bit
        if target.suffix != ".h5" and use == "inspect":
            use = "info"  # that shows dumps alone
        target.write_bytes(content)
        kind = target.suffix.lstrip(".")
        what = f"{use}, {problem}, {target.name} byte {place} bit {bit}"
        if use == "restart":
            outcome = self._restart(run, problem, target)
        else:
            outcome = self._look(use, run, half, target, folder)
        return Outcome(f"{kind}: {outcome.label}", outcome.defect, f"{what}: {outcome.words}")

    def _restart(self, run: Path, problem: str, target: Path) -> Outcome:
        whole = self.folder / f"{problem}-whole"
        done = call(list_restart(run), run.parent)
        if fault := find_fault(done):
            return fault
        said = is_said(done.out + done.err, target)
        if done.code:
            label = "refused by name" if target.name in done.err else "refused"
            return Outcome(label, False, tell_last(done))
        spoiled = find_spoiled(run, whole, target)
        if spoiled:
            label = "damage reported, restart continues" if said else "SILENT: restart continues"
            return Outcome(label, not said, ", ".join(spoiled[:4]))
        if said:
            return Outcome("damage reported and bypassed, bitwise equal")
        # the damaged file itself may hold other numbers still: is that seen by who reads it?
        compared = call(["compare", str(whole), str(run)], run.parent)
        if fault := find_fault(compared, (0, 1, 2, 3)):
            return fault
        if compared.code == 1 and not is_said(compared.out + compared.err, target):
            return Outcome("kept in its file, seen by compare alone", True, tell_last(compared))
        return Outcome("harmless, bitwise equal" if not compared.code else "named by compare")

    def _look(self, use: str, run: Path, half: Path, target: Path, folder: Path) -> Outcome:
        words = {
            "info": [["info", str(run)], ["info", str(half)]],
            "inspect": [["inspect", str(p)] for p in (target, half / "dumps" / target.name)],
            "compare": [["compare", str(half), str(run)], ["compare", str(half), str(half)]],
            "plot": [["plot", str(p), "-o", str(folder / "a.png")] for p in (run, half)],
        }[use]
        done = call(words[0], folder)
        if fault := find_fault(done, (0, 1, 2, 3)):
            return fault
        if use == "plot":
            picture = (folder / "a.png").read_bytes() if (folder / "a.png").exists() else b""
        if done.code == 2 or is_said(done.out + done.err, target):
            return Outcome("refused by name" if done.code else "damage reported")
        if done.code == 1:
            return Outcome("seen by compare")
        like = call(words[1], folder)
        same = done.out.replace(str(run), "") == like.out.replace(str(half), "")
        if use == "plot":
            same = picture == (folder / "a.png").read_bytes()
        if use == "compare":
            same = True  # it found no difference in all that it reads
        return Outcome("harmless, the same answer") if same else Outcome(f"SILENT: {use}", True)


def list_restart(run: Path) -> list[str]:
    """The command that goes on with half a run to its end."""
    return ["restart", str(run), "-q", "--set", f"run.max_steps={END}"]


def is_said(text: str, target: Path) -> bool:
    """Does a text tell of the damage: the file's name and a word for it?"""
    return target.name in text and any(word in text for word in SAID)


def find_spoiled(run: Path, whole: Path, target: Path) -> list[str]:
    """Files, but for the damaged one, that have other bits than those of the undisturbed run."""
    found = []
    for path in sorted((whole / "dumps").glob("dump_*.h5")):
        other = run / "dumps" / path.name
        if path.name != target.name or target.suffix != ".h5":
            if not other.exists() or other.read_bytes() != path.read_bytes():
                found.append(path.name)
    if read_rows(run / "history.csv") != read_rows(whole / "history.csv"):
        found.append("history.csv")
    return found


def read_rows(path: Path) -> list[list[str]]:
    """The lines of a history without its wall times."""
    rows = [line.split(",") for line in path.read_text("utf-8", "replace").splitlines()]
    kept = [k for k, name in enumerate(rows[0] if rows else ()) if not name.startswith(TIMED)]
    return [[row[k] for k in kept if k < len(row)] for row in rows]
