"""CloverLeaf_ref, PENNANT and AMRClaw, built in a copy of their checkout for a case's start.

CloverLeaf_ref (staggered Lagrange step and second-order remap, compiled Fortran) has reflecting
walls only.  An interface is computed in the frame of the shocked gas at the left wall, in a domain
so long that no wall's wave reaches it.  Changed: its start knows a cosine between two densities,
with the shares of cut cells, and its dumps have more digits.

PENNANT (staggered Lagrange on polygons, axisymmetric, compiled C++).  Changed: its last dump has
the cells' centres and volumes beside the densities, and its walls are the case's.

AMRClaw (PyClaw's method with adaptive refinement, compiled Fortran).  Its start is
`amr_start.f90`; `amr_peer.py` runs it.
"""

from __future__ import annotations

import functools
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.race.python_peers import find_line, x_shock

FORTRAN = "-O3 -march=native -funroll-loops -fallow-argument-mismatch"
CLOVERLEAF_START = """
  !$OMP END PARALLEL
  DO k=y_min-2,y_max+2
    DO j=x_min-2,x_max+2
      share=0.0_8
      DO kt=1,16
        line={a0:.15g}_8*COS(6.283185307179586_8*(vertexy(k)+(kt-0.5_8)/16.0_8*(vertexy(k+1)-vertexy(k))))
        share=share+MAX(0.0_8,MIN(1.0_8,(vertexx(j+1)-line)/(vertexx(j+1)-vertexx(j))))/16.0_8
      ENDDO
      IF (share.GT.0.0_8) THEN
        density0(j,k)=1.0_8+{step:.15g}_8*share
        energy0(j,k)=1.0_8/(0.4_8*density0(j,k))
      ENDIF
    ENDDO
  ENDDO

  END SUBROUTINE generate_chunk_kernel"""
# a line of a deck has at most 100 characters
CLOVERLEAF_STATE = (
    " state 2 density=1 energy=2.5 xvel={velocity:.6f} geometry=rectangle"
    " xmin={shock:.4f} xmax=99 ymin=0 ymax=1"
)
CLOVERLEAF_DECK = """*clover
 state 1 density={left[0]:.9g} energy={energy:.9g}
{state}
 x_cells={nx}
 y_cells={ny}
 xmin={x0:.9g}
 ymin=0.0
 xmax={x1:.9g}
 ymax=0.5
 initial_timestep=0.0001
 timestep_rise=1.5
 max_timestep=0.1
 end_time={t_end:.9g}
 {dumps}
*endclover
"""
PENNANT_DUMP = """    Parallel::gatherv(&zp[0], numz, &gzp[0], &penumz[0]);
    if (mype == 0) {
        ofstream race((basename + ".race").c_str());
        race << scientific << setprecision(12);
        for (int z = 0; z < numz; ++z)
            race << mesh->zx[z].x << " " << mesh->zx[z].y << " "
                 << zr[z] << " " << mesh->zvol[z] << endl;
    }
"""

AMRCLAW_MAKE = """CLAW_PKG = amrclaw
EXE = xamr
AMRLIB = $(CLAW)/amrclaw/src/2d
include $(AMRLIB)/Makefile.amr_2d
EXCLUDE_SOURCES = $(AMRLIB)/qinit.f90 $(AMRLIB)/setprob.f90
RIEMANN = $(CLAW)/riemann/src
SOURCES = ./amr_start.f90 $(RIEMANN)/rpn2_euler_4wave.f90 $(RIEMANN)/rpt2_euler.f90
include $(CLAW)/clawutil/src/Makefile.common
"""


@functools.cache
def build_amrclaw(checkouts: Path, python: str) -> Path:
    """The program, built in a copy of a folder with amrclaw, classic, clawutil and riemann."""
    work = Path(tempfile.mkdtemp()) / "claw"
    shutil.copytree(checkouts, work)
    shutil.copy(Path(__file__).with_name("amr_start.f90"), work)
    (work / "Makefile").write_text(AMRCLAW_MAKE)
    flags = {"CLAW": str(work), "CLAW_PYTHON": python, "FFLAGS": "-O3 -march=native"}
    environment = os.environ | flags
    subprocess.run(["make", ".exe"], cwd=work, env=environment, check=True, capture_output=True)
    return work / "xamr"


def build_cloverleaf(checkout: Path, numbers: dict[str, Any]) -> Path:
    """The folder of a built copy that starts from this interface."""
    work = Path(tempfile.mkdtemp()) / "cloverleaf"
    shutil.copytree(checkout, work)
    kernel = work / "kernels" / "generate_chunk_kernel.f90"
    text = kernel.read_text()
    start = CLOVERLEAF_START.format(a0=numbers["a0"], step=numbers["heavy"][0] - 1.0)
    text = text.replace("  !$OMP END PARALLEL\n\n  END SUBROUTINE generate_chunk_kernel", start)
    declared = "INTEGER      :: j,k,jt,kt\n"
    kernel.write_text(text.replace(declared, f"{declared}    REAL(KIND=8) :: share,line\n", 1))
    dumps = work / "visit.f90"
    short = "'(e12.4)')(chunk%tiles(tile)%field%density0"
    dumps.write_text(dumps.read_text().replace(short, short.replace("12.4", "17.9")))
    make = ["make", "COMPILER=GNU", "MPI_COMPILER=mpif90", "C_MPI_COMPILER=mpicc"]
    flags = [f"FLAGS_GNU={FORTRAN}", "CFLAGS_GNU=-O3 -march=native"]
    subprocess.run([*make, *flags], cwd=work, check=True, capture_output=True)
    return work


def run_cloverleaf(
    work: Path, name: str, numbers: dict[str, Any], cells: int
) -> tuple[dict, float]:
    """What was found, and the CPU seconds of the run without dumps."""
    push = numbers["left"][1] - numbers["right"][1]
    shock = x_shock(numbers)
    wait = -shock / numbers["front"]
    t_end = wait + numbers["times"][-1]
    rho, _, p = numbers["left"]
    sound = (numbers["gamma"] * p / rho) ** 0.5
    # the wall's echo, and the fan of the gas that leaves the right wall
    x0 = -0.75 * sound * t_end - push * wait
    x1 = (1.19 + push) * t_end
    nx, ny = round((x1 - x0) * cells), cells // 2
    deck = CLOVERLEAF_DECK.format(
        left=(rho,), energy=p / ((numbers["gamma"] - 1.0) * rho),
        state=CLOVERLEAF_STATE.format(velocity=-push, shock=shock),
        nx=nx, ny=ny, x0=x0, x1=x0 + nx / cells, t_end=1.001 * t_end,
        dumps=f"visit_frequency={max(1, cells // 8)}",
    )  # fmt: skip
    timed = re.sub(" visit.*\n", "", deck)
    home = work.parent / f"run{cells}"
    home.mkdir()
    (home / "clover.in").write_text(timed)
    spent = spend([str(work / "clover_leaf")], home)
    (home / "clover.in").write_text(deck)
    spend([str(work / "clover_leaf")], home)
    log = (home / "clover.out").read_text()
    steps = re.findall(r"^ *Step +(\d+) +time +([\d.E+-]+)", log, re.MULTILINE)
    times = {int(n): float(t) for n, t in steps}
    x, y = x0 + (np.arange(nx) + 0.5) / cells, (np.arange(ny) + 0.5) / cells
    found: dict[str, list[float]] = {"t": [], "amplitude": []}
    for path in sorted(home.glob("*.vtk")):
        t = times.get(int(path.name.split(".")[-2]), 0.0) - wait
        if t > 0.8 * numbers["times"][0]:
            part = path.read_text().split("density", 1)[1].split("\n", 1)[1].split("energy", 1)[0]
            field = np.array(part.split(), float).reshape(ny, nx).T
            found["t"].append(t)
            found["amplitude"].append(find_line(name, numbers, field, x, y))
    shutil.rmtree(home)
    return found, spent


def build_pennant(checkout: Path) -> Path:
    """The folder of a built copy, one core."""
    work = Path(tempfile.mkdtemp()) / "pennant"
    shutil.copytree(checkout, work)
    dump = work / "src" / "WriteXY.cc"
    last = "    Parallel::gatherv(&zp[0], numz, &gzp[0], &penumz[0]);\n"
    text = dump.read_text().replace(last, PENNANT_DUMP)
    dump.write_text(
        text.replace('#include "WriteXY.hh"\n', '#include "WriteXY.hh"\n#include "Vec2.hh"\n')
    )
    make = ["make", "CXX=g++", "CXXFLAGS=-O3 -march=native", "LDFLAGS=", "LD=g++"]
    subprocess.run(make, cwd=work, check=True, capture_output=True)
    return work


def run_pennant(work: Path, name: str, numbers: dict[str, Any], cells: int) -> tuple[dict, float]:
    """What was found, and the CPU seconds of the run."""
    size = numbers["size"]
    deck = [
        f"tstop {numbers['t_end']}", "cstop 999999", "meshtype rect",
        f"meshparams {cells} {cells} {size} {size}", "bcx 0.0", "bcy 0.0",
        f"gamma {numbers['gamma']}",
        "ssmin 0.1", "q1 0.1", "q2 1.0", "dtinit 1.e-5", "writexy 1", "chunksize 512",
    ]  # fmt: skip
    if name == "noh":
        deck += ["uinitradial -1.0", "alfa 0.1"]
    else:
        first = size / cells
        deck += [
            f"bcx 0.0 {size}", f"bcy 0.0 {size}", f"subregion 0.0 {first} 0.0 {first}",
            "rinitsub 1.0", f"einitsub {numbers['energy'] / (0.5 * first**3)}",
        ]  # fmt: skip
        deck = [line for line in deck if line not in ("bcx 0.0", "bcy 0.0")]
    home = Path(tempfile.mkdtemp())
    (home / "race.pnt").write_text("\n".join(deck) + "\n")
    spent = spend([str(work / "build" / "pennant"), "race.pnt"], home)
    x, y, rho, volume = np.loadtxt(home / "race.race").T
    found = {"x": x, "y": y, "rho": rho, "volume": volume}
    shutil.rmtree(home)
    return found, spent


def spend(command: list[str], home: Path, given: str | None = None) -> float:
    """CPU seconds (user and system) of a command; CalledProcessError if it fails."""
    before = sum(os.times()[2:4])
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    one = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}  # one core
    kept = {"PYTHONDONTWRITEBYTECODE": ""}  # all codes in Python start from bytecode on the disk
    done = subprocess.run(
        command,
        cwd=home,
        env=os.environ | allowed | one | kept,
        input=given,
        capture_output=True,
        text=True,
        check=True,
    )
    (home / "stdout").write_text(done.stdout)
    return sum(os.times()[2:4]) - before
