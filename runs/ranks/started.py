"""Has somebody started this process as one of several, with mpiexec or srun?

Asked of the environment alone: MPI takes a second to begin, and is not everywhere.
"""

from __future__ import annotations

import os

from shockgrid.regrid.errors import BadInput

# what Open MPI, MPICH and its kin, and a step of Slurm with PMIx say
SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE")
RANKS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK")
SLURM = "SLURM_STEP_NUM_TASKS"
COMMANDS = ("run", "restart")  # that work on ranks


def count_started() -> int:
    """Ranks that were started with this one, itself included; 1 where nothing is said."""
    found = [_read_number(name) for name in SIZES]
    if "PMIX_RANK" in os.environ:
        found.append(_read_number(SLURM))
    return max(1, *found)


def find_rank() -> int:
    """Which of them this is, from 0 on."""
    return max(0, *(_read_number(name) for name in RANKS))


def is_for_ranks(arguments: list[str]) -> bool:
    """Were several ranks started for a command line that computes one flow on them?"""
    names = [word for word in arguments if not word.startswith("-")]
    return bool(names) and names[0] in COMMANDS and count_started() > 1


def check_single(call: str, command: str) -> None:
    """Raise BadInput where several ranks were started: each would make the whole run of a script.

    call: of Python; command: `run ...` or `restart ...`, which shares a run among the ranks.
    """
    ranks = count_started()
    if ranks > 1:
        raise BadInput(
            f"{ranks} ranks of MPI were started with this script, and each of them would make the "
            f"whole run: {call} computes in one process. Start the script without mpiexec, or the "
            f"run on the ranks by mpiexec -n {ranks} shockgrid {command}; many runs at once are "
            "for shockgrid.study"
        )


def _read_number(name: str) -> int:
    text = os.environ.get(name, "")
    return int(text) if text.isdecimal() else 0
