"""What made a file: versions, commit, machine and deck, for dumps, logs and tables.

All of it is the same in every run of one deck on one machine, so dumps keep their bits: no time of
day, no wall time, no name of a host.  Note: an installed package may lie inside somebody
else's repository; git is asked only where the `.git` beside the packages is our own.
"""

from __future__ import annotations

import functools
import hashlib
import json
import platform
import subprocess
from importlib import metadata
from pathlib import Path

HOME = Path(__file__).resolve().parents[2]  # the folder in which the packages lie
DISTRIBUTION = "shockgrid"
NOTED_DIGITS = 16  # digits of a digest that screens and logs show
COMMIT_DIGITS = 12  # of a commit
PACKAGES = ("numpy", "numba", "scipy", "h5py")


def find_provenance(deck_text: str | None = None) -> dict[str, str]:
    """Words by name: version, commit ("" where unknown), platform, packages, hash of the deck.

    deck_text: the resolved deck as TOML; None of what is made without one.
    """
    deck = {} if deck_text is None else {"deck_sha256": hash_deck(deck_text)}
    return {**_find_surroundings(), **deck}


def hash_deck(deck_text: str) -> str:
    """SHA-256 of a resolved deck as TOML, as 64 hexadecimal digits."""
    return hashlib.sha256(deck_text.encode("utf-8")).hexdigest()


def describe_provenance(provenance: dict[str, str]) -> list[str]:
    """`provenance` in two lines for a screen: what computed, and what was computed."""
    known = {name: value for name, value in provenance.items() if value}
    packages = [f"{name} {known[name]}" for name in ("python", *PACKAGES) if name in known]
    made = [f"shockgrid {known.get('version', 'of unknown version')}"]
    if "commit" in known:
        made.append(f"commit {known['commit']}")
    lines = [f"made by: {', '.join([*made, *packages])}; {known.get('platform', '?')}"]
    if "deck_sha256" in known:
        lines.append(f"deck: SHA-256 {known['deck_sha256'][:NOTED_DIGITS]}")
    return lines


def describe_software() -> str:
    """Version and commit in one line: what a picture, a film or a table was made by."""
    known = _find_surroundings()
    software = f"shockgrid {known['version'] or 'of unknown version'}"
    return f"{software}, commit {known['commit']}" if known["commit"] else software


@functools.cache
def _find_surroundings() -> dict[str, str]:
    return {
        "version": _find_version(DISTRIBUTION),
        "commit": find_commit(HOME),
        "platform": platform.platform(),
        "python": platform.python_version(),
        **{name: _find_version(name) for name in PACKAGES},
    }


def _find_version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:  # a bare checkout
        return ""


def find_commit(home: Path) -> str:
    """The commit of the packages in `home`, "-dirty" behind it where files differ; "" unknown.

    Of a checkout by git; of an installed package what its installer noted (PEP 610).
    """
    if (home / ".git").exists():
        command = ["git", "--no-optional-locks", "-C", str(home), "status", "--porcelain=v2"]
        command += ["--branch", "--no-ahead-behind", "--untracked-files=no"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=20)
        except (OSError, subprocess.SubprocessError):
            return ""
        head, *lines = done.stdout.splitlines() or [""]  # "# branch.oid <commit>", then others
        commit = head.rpartition(" ")[2]
        if done.returncode or commit == "(initial)":
            return ""
        differs = any(not line.startswith("#") for line in lines)
        return commit[:COMMIT_DIGITS] + ("-dirty" if differs else "")
    try:
        noted = metadata.distribution(DISTRIBUTION).read_text("direct_url.json")
    except metadata.PackageNotFoundError:
        return ""
    return str(json.loads(noted or "{}").get("vcs_info", {}).get("commit_id", ""))
