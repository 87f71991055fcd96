"""What all tests share: hypothesis without chance in CI, renewed baselines, who compiles what."""

from __future__ import annotations

import fnmatch
import importlib.util
import os
from pathlib import Path, PurePath

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

# nothing fails for the time that it takes
UNTIMED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("ci", derandomize=True, print_blob=True, **UNTIMED)
settings.register_profile("dev", **UNTIMED)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "dev"))

# runs that tests start compile in one process: pytest's workers have the other processors
os.environ["SHOCKGRID_COMPILERS"] = "1"


def pytest_configure(config):
    """End here where Python would import the packages of another tree."""
    found = importlib.util.find_spec("shockgrid.hydro")
    if found is None or Path(found.origin).resolve().parents[1] != config.rootpath.resolve():
        where = "not installed" if found is None else f"that of {found.origin}"
        pytest.exit(f"shockgrid.hydro is {where}: run `make setup` in {config.rootpath}", 4)


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


@pytest.fixture
def check_steps(update_baselines):
    """Compare rows of steps with a stored table, or write it; `counts` columns are exact."""

    def check(found, path, columns, tolerance, counts=0):
        if update_baselines:
            form = ["%d"] * counts + ["%.13e"] * (len(columns) - counts)
            np.savetxt(path, found, fmt=form, header=" ".join(columns))
            return
        stored = np.loadtxt(path, ndmin=2)
        assert found.shape == stored.shape
        for k, column in enumerate(columns):
            allowed = tolerance if k >= counts else 0.0
            near = np.isclose(found[:, k], stored[:, k], rtol=allowed, atol=0.0)
            first = near.argmin()
            assert near.all(), (
                f"{path.stem}: {column} differs first in step {first + 1}: "
                f"{found[first, k]:.15g}, stored {stored[first, k]:.15g}"
            )

    return check


# Compiling the kernels of one equation of state, limiter, geometry and flux takes some 25 seconds.
# What alone needs a set of them is slow: `make verify` runs it.
RARE_KERNELS = (
    "property/test_flow.py::*[[]stiffened gas]",
    "regression/test_standard_steps.py::*[[]conical-target*",
    "regression/test_standard_steps.py::*[[]saltzmann]",
    "regression/test_standard_steps.py::*[[]gresho]",
    "regression/test_standard_steps.py::*[[]detonation]",
    "regression/test_standard_steps.py::*[[]sedov-spherical]",
    "unit/hydro/remap/test_lines_come_and_go.py::test_threads*",
    "unit/hydro/test_burn.py::*heat_of_its_mass",
    "unit/hydro/test_burn.py::*what_its_state_lacks",
    "unit/hydro/test_pieces.py::*partial_cover",
    "unit/problems/test_interface_starts.py::*alumini*",
    "unit/problems/test_interface_starts.py::*[[]stiffened]",
    "unit/problems/test_settled_shock.py::*stiffened gas]",
    "verification/contacts/test_plates_that_meet.py::*[[]gas-water]",
    "verification/problems/test_flat_lines.py::*between_metals",
    "verification/problems/test_standard_flows.py::*[[]TNT]",
    "verification/problems/test_standard_flows.py::*a_square_lit*",
    "verification/problems/test_standard_flows.py::test_sedov[[]spherical*",
    "verification/problems/test_standard_flows.py::test_restart_of_a_grid*",
    "verification/problems/test_riemann.py::test_star_states[[]toro3]",
    "verification/problems/test_riemann.py::test_star_states[[]water-gas]",
    "verification/problems/test_standard_problems.py::test_five*[[]conical-target]",
    "verification/problems/test_standard_problems.py::test_five*[[]saltzmann]",
    "verification/problems/test_standard_problems.py::test_five*[[]gresho]",
    "verification/problems/test_standard_problems.py::test_five*[[]detonation]",
    "verification/scheme/test_axisymmetric.py::test_restart_and_threads*",
    "verification/scheme/test_free_stream.py::*[[]gas and water]",
    "verification/scheme/test_low_mach.py::test_gresho*",
    "verification/scheme/test_low_mach.py::test_the_flow_is*",
    "verification/scheme/test_pistons.py::*[[]water*",
    "verification/scheme/test_pistons.py::*[[]liquid]",
    "verification/scheme/test_reference_step.py::*[[]metal-*",
    "verification/scheme/test_reference_step.py::*[[]low-mach]",
    "verification/scheme/test_reference_step.py::*[[]minmod]",
    # smooth-low-mach has its slopes
    "verification/scheme/test_reference_step.py::*[[]generalised-minmod]",
    "verification/scheme/test_reference_step.py::*hll_alone",
)

# With a cold cache nearly all time goes into compiling.  Under `--dist loadfile` files that need
# the same kernels run in one process, so that two do not compile them at once; the longest groups
# come first, all other files after them one by one.
KERNEL_GROUPS = {
    "limiters, geometries": (
        "regression/test_standard_steps.py", "unit/hydro/test_hydro_steps.py",
        "unit/hydro/test_corner_guard.py", "verification/problems/test_bubbles.py",
        "verification/problems/test_standard_*.py", "verification/scheme/*.py",
    ),
    "regridders": (
        "io/test_grid_*.py", "property/test_barrier_motions.py", "property/test_regridders.py",
        "regression/test_grid_march.py", "unit/regrid/*.py", "unit/regrid/*/*.py",
        "verification/problems/test_domain_marches.py",
    ),
    "metals, interfaces": (
        "io/output/*.py", "io/test_restart_*.py", "property/test_flow*.py",
        "unit/hydro/ranks/*.py", "unit/hydro/remap/*.py", "unit/hydro/test_pieces.py",
        "unit/problems/*.py", "verification/contacts/*.py", "verification/problems/*.py",
    ),
    # processes of their own take long: these come before the shorter files
    "cache": ("unit/test_kernel_cache.py",), "ranks": ("io/mpi/*.py",),
    "studies": ("io/studies/*.py",),
}  # fmt: skip


def find_group(nodeid: str) -> tuple[int, str]:
    """Number and name of the group that compiles what a test needs; its file's name in none."""
    file = nodeid.split("::")[0]
    for number, (name, patterns) in enumerate(KERNEL_GROUPS.items()):
        if any(PurePath(file).match(pattern) for pattern in patterns):
            return number, name
    return len(KERNEL_GROUPS), file


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    for item in items:
        name = item.nodeid.removeprefix("tests/")
        if any(fnmatch.fnmatchcase(name, pattern) for pattern in RARE_KERNELS):
            item.add_marker(pytest.mark.slow)
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
