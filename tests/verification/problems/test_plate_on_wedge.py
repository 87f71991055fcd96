"""The plate on the wedge against shock polars; its jet, its images, its balance, its restarts."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from builders import collect_columns, tensor
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import slide
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.plate_on_wedge.problem import PlateOnWedge, PlateOnWedgeDeck
from shockgrid.problems.plate_on_wedge.report import (
    measure_behind,
    measure_contact_speed,
    measure_lead,
    measure_plateau,
)
from shockgrid.problems.plate_on_wedge.run import has_closed_notch
from shockgrid.problems.references.hugoniot import release, shock_to_pressure
from shockgrid.regrid.measure.quality import least_corner_area
from shockgrid.runs.cli.main import main
from shockgrid.runs.store.reader import RunData

BAR_PRESSURE = 0.01
BAR_ANGLE = 0.15
BAR_SPEED = 0.02
ALONG = 0.97  # of the face: the polars are measured before A comes to B


def make_problem(**options) -> PlateOnWedge:
    return PlateOnWedge(msgspec.convert(options, PlateOnWedgeDeck))


def march_convex(problem, until=None):
    """Run to the end or until `until(run)`; returns run and history.  Every cell is convex."""
    run = problem.build()
    rows = []
    while not run.finished and not (until and until(run)):
        rows.append(run.advance() | run.measure())
        for block in run.blocks:
            assert least_corner_area(block.nodes) > 0.0, (block.name, run.step)
    return run, collect_columns(rows)


def check_balance(start: dict, history: dict) -> None:
    """Masses, and the energy against the work of the drive."""
    for name in ("mass_plate", "mass_wedge", "energy"):
        miss = history[f"total_{name}"] - history[f"boundary_{name}"] - start[f"total_{name}"]
        assert np.abs(miss).max() < 1e-12 * np.abs(history[f"total_{name}"]).max(), name


def has_arrived(run) -> bool:
    return math.isfinite(run.times["arrived"])


def check_attached(problem, bar=BAR_PRESSURE, bar_angle=BAR_ANGLE) -> None:
    def is_far(run):
        return run.measure()["contact_path"] > ALONG * problem.deck.face

    _, history = march_convex(problem, is_far)
    theory = problem.collision
    behind = measure_behind(problem, history)
    speed, spread = measure_contact_speed(problem, history)
    assert speed == pytest.approx(theory.contact_speed, rel=BAR_SPEED) and spread < BAR_SPEED
    assert measure_plateau(problem, history).p == pytest.approx(theory.p, rel=bar)
    for name, wave in (("theta_plate", theory.plate), ("theta_wedge", theory.wedge)):
        miss = math.degrees(behind[name] - wave.deflection)
        assert abs(miss) < bar_angle, (name, miss)
    assert measure_lead(problem, history) < 0.2 * problem.length / problem.deck.cells[0]
    assert history["jet_speed"].max() == 0.0


def make_flying(wedge, speed, angle, cells) -> PlateOnWedge:
    drive = {"kind": "moving", "speed": speed}
    return make_problem(wedge=wedge, angle=angle, drive=drive, cells=cells)


def test_attached_shocks():
    check_attached(make_flying("SS304", 2000.0, 10.0, (60, 18)))


@pytest.mark.slow
@pytest.mark.parametrize("cells", [(80, 24), (160, 48)], ids=str)
@pytest.mark.parametrize("wedge", ["SS304", "Al1100"])
@pytest.mark.parametrize("speed, angle", [(2e3, 8.0), (2e3, 10.0), (3e3, 10.0), (3e3, 12.0)])
def test_table_of_attached_shocks(wedge, speed, angle, cells):
    check_attached(make_flying(wedge, speed, angle, cells))


def check_jet(problem, share) -> None:
    """Material runs ahead of the contact point of theory, more and more."""
    spacing = problem.length / problem.deck.cells[0]

    def is_far(run):
        return run.measure()["contact_path"] > share * problem.deck.face

    run, history = march_convex(problem, is_far)
    assert not problem.collision.attached
    assert not has_arrived(run)
    lead = history["lead"]
    assert lead[-1] > 0.5 * spacing
    assert lead[len(lead) // 2] < 0.8 * lead[-1]
    speed, _ = measure_contact_speed(problem, history)
    assert speed > 1.02 * problem.collision.contact_speed


def test_jet_ahead_of_the_contact_point():
    check_jet(make_flying("SS304", 2000.0, 16.0, (60, 18)), 0.6)


@pytest.mark.slow
@pytest.mark.parametrize("wedge", ["SS304", "Al1100"])
@pytest.mark.parametrize("speed, angle", [(2e3, 16.0), (3e3, 20.0)])
def test_table_of_jets(wedge, speed, angle):
    check_jet(make_flying(wedge, speed, angle, (80, 24)), 0.6)


def test_the_default_ends_by_itself_and_keeps_its_sums():
    problem = make_problem(cells=(48, 14))
    start = problem.build().start_row()
    run, history = march_convex(problem)
    assert run.finished.startswith(("cavity closed", "the jet has met")), run.finished
    check_balance(start, history)
    speed, spread = measure_contact_speed(problem, history)
    assert speed == pytest.approx(problem.collision.contact_speed, rel=BAR_SPEED)
    assert spread < BAR_SPEED
    times = run.times
    assert times["attached"] < times["arrived"] < times["jet"] < times["closed"] == run.t


IMPACTS = {  # plate, target: pressure [Pa] and velocity [m/s] behind an impact at 2 km/s
    ("Al1100", "SS304"): (26.97967e9, 621.767),
    ("SS304", "Pb"): (43.80328e9, 1068.685),
    ("Al1100", "Pb"): (24.85395e9, 709.413),
}


@pytest.mark.parametrize("pair", IMPACTS, ids="-".join)
def test_impact_on_a_sliding_contact(pair):
    """100 cells in the plate, 3 against 4 along the contact: plateaus within 0.3 %, and the back of
    the target, where the shock is at 1.15 µs, then flies at the isentrope's speed within 0.2 %."""
    p, u = IMPACTS[pair]
    target = find_material(pair[1])
    shock = shock_to_pressure(target.eos, target.rho0, 0.0, p)
    columns = round(shock.shock_speed * 1.15e-6 / 1e-4)
    blocks = []
    for name, rows, speed, cells in zip(pair, (3, 4), (2000.0, 0.0), (100, columns), strict=True):
        x = (np.arange(cells + 1) - (0 if blocks else cells)) * 1e-4
        y = np.linspace(0.0, 4e-4, rows + 1)
        solid = find_material(name)
        nodes = tensor(x, y)
        block = Block(f"{name}{cells}", solid.eos, nodes, solid.rho0, speed, 0.0, 0.0)
        for side in ("j_min", "j_max", "i_max" if blocks else "i_min"):
            put(block, side, "wall" if side[0] == "j" else "free-surface")
        blocks.append(block)
    link = slide((blocks[1], "i_min"), (blocks[0], "i_max"))
    run = Simulation(blocks, [link], t_end=1.6e-6)
    track = []
    while not run.finished:
        run.advance()
        if run.t > 1.25e-6:
            track.append((run.t, blocks[1].nodes[0, -1].mean()))
    start, back = track[0]
    stop, further = track[-1]
    released = shock.particle_speed + release(target.eos, shock.rho, p)[1]
    assert (further - back) / (stop - start) == pytest.approx(released, rel=2e-3)
    for block, part in zip(blocks, (slice(-30, -8), slice(6, columns // 3)), strict=True):
        state = block.state[:, 1:-1, 1:-1][:, part]
        assert state[3].mean() == pytest.approx(p, rel=3e-3), block.name
        assert state[1].mean() == pytest.approx(u, rel=3e-3), block.name


SMALL = ("--set=cells=[40,12]", "--set=output.dumps=4", "-q")


@pytest.mark.parametrize("phase", ["attached", "arrived"])
def test_a_restart_has_the_same_end(phase, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "plate-on-wedge", *SMALL, "-o", "whole"]) == 0
    history = RunData("whole").history
    number = {"attached": 1, "arrived": 2}[phase]
    rows = np.flatnonzero(np.asarray(history["phase"], dtype=float) == number)
    middle = int(history["step"][rows[rows.size // 2]])
    limit = f"--set=run.max_steps={middle}"
    assert main(["run", "plate-on-wedge", *SMALL, "-o", "other", limit]) == 0
    assert main(["restart", "other", "-q", "--set", "run.max_steps=99999"]) == 0
    for name in ("whole", "other"):
        RunData(name).directory.dump_path(middle).unlink(missing_ok=True)
    capfd.readouterr()
    code = main(["compare", "whole", "other"])
    text = capfd.readouterr().out
    assert (code, text.splitlines()[-1]) == (0, "no difference between whole and other"), text


@pytest.mark.parametrize(("depth", "closed"), [(1.0, True), (-1.0, False)])
@pytest.mark.parametrize("width", [0.01, 0.1])
def test_a_notch_closes_and_the_tip_of_a_jet_does_not(depth, closed, width):
    """The outside is below: a notch goes up into the plate, a jet hangs down from it."""
    line = np.array([[0.0, 1.0, 2.0, 2.0, 2.0 + width, 3.0, 4.0], [0, 0, 0, depth, 0, 0, 0]])
    assert has_closed_notch(line, np.full(7, 0.02)) == (closed and width < 0.02)
