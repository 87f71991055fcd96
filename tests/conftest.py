"""What all tests share: hypothesis without chance in CI, renewed baselines, who compiles what."""

from __future__ import annotations

import os
from pathlib import PurePath

import pytest
from hypothesis import settings

settings.register_profile("ci", derandomize=True, deadline=None, print_blob=True)
settings.register_profile("dev", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "dev"))


def pytest_addoption(parser):
    parser.addoption(
        "--update-baselines",
        action="store_true",
        help="write the baselines of tests/regression instead of comparing with them",
    )


@pytest.fixture
def update_baselines(request) -> bool:
    """Whether to write a baseline instead of comparing with it."""
    return request.config.getoption("--update-baselines")


# With a cold cache nearly all time goes into compiling kernels.  Under `--dist loadfile` files
# that need the same ones run in one process, so that two do not compile them at once; the longest
# groups come first, all other files after them one by one.
KERNEL_GROUPS = {
    "limiters, geometries, explosives": (
        "unit/hydro/test_body_sources.py", "unit/hydro/test_burn.py",
        "unit/hydro/test_corner_guard.py", "regression/test_standard_steps.py",
        "verification/problems/test_standard_problems.py", "io/test_pictures.py",
        "io/seeing/test_plot_options.py",
        "verification/problems/test_detonation.py", "verification/problems/test_noh_sedov.py",
        "verification/problems/test_standard_bubble.py", "verification/scheme/test_axisymmetric.py",
        "verification/problems/test_bubble_on_fixed_grid.py",
        "verification/scheme/test_junctions.py", "verification/scheme/test_low_mach.py",
        "verification/scheme/test_piston_start.py",
    ),
    "regridders": (
        "unit/regrid/*.py", "unit/regrid/*/*.py", "unit/problems/test_regrid_deck.py",
        "property/test_regridders.py", "property/test_barrier_motions.py", "io/test_grid_*.py",
        "regression/test_grid_march.py", "verification/problems/test_domain_marches.py",
        "docs/test_python_page.py",
    ),
    "metals, liquids, tables": (
        "io/test_restart_*.py", "io/output/*.py", "property/test_flow_*.py",
        "unit/hydro/test_eos_tabular.py",
        "unit/hydro/test_hydro_*.py", "unit/hydro/test_pieces.py",
        "unit/problems/test_settled_shock.py", "verification/problems/test_shocked_line.py",
        "verification/problems/test_riemann.py", "verification/problems/test_plate_on_wedge.py",
        "verification/scheme/test_free_*.py", "verification/scheme/test_plane_shock.py",
        "verification/scheme/test_seams.py",
    ),
}  # fmt: skip


def find_group(nodeid: str) -> tuple[int, str]:
    """Number and name of the group that compiles what a test needs; its file's name in none."""
    file = nodeid.split("::")[0]
    for number, (name, patterns) in enumerate(KERNEL_GROUPS.items()):
        if any(PurePath(file).match(pattern) for pattern in patterns):
            return number, name
    return len(KERNEL_GROUPS), file


def pytest_collection_modifyitems(config, items):
    if hasattr(config, "workerinput"):
        items.sort(key=lambda item: find_group(item.nodeid)[0])


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """`--dist loadfile`, the files of a group counted as one."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class KernelScheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return find_group(nodeid)[1]

    return KernelScheduling(config, log)
