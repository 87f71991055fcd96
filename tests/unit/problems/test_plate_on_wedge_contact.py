"""`plate-on-wedge`: the plateau behind A, the finer cells near the critical angle, the verdict."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from problems.plate_on_wedge.deck import PlateOnWedgeDeck
from problems.plate_on_wedge.plateau import COLUMNS, EDGES, NOTHING, find_plateau, measure_profile
from problems.plate_on_wedge.problem import PlateOnWedge
from problems.plate_on_wedge.report import (
    describe_margin,
    describe_nearness,
    describe_plateau,
    describe_verdict,
)
from regrid.curves import RATIO, fill_grown_law, meeting_laws

PATH = 20e-3


def make_problem(**options) -> PlateOnWedge:
    return PlateOnWedge(msgspec.convert(options, PlateOnWedgeDeck))


def make_flying(speed=3000.0, **options) -> PlateOnWedge:
    return make_problem(drive={"kind": "moving", "speed": speed}, **options)


# --- the plateau --------------------------------------------------------------------------------


def make_profiles(pressure, face=2e-4, rise=3.0, noise=0.0) -> np.ndarray:
    """Rows of some steps: `pressure` of the part of the path behind A, spread by a scheme's rise.

    The rise has a crest and a dip behind it, all counted in faces.
    """
    random, rows = np.random.default_rng(3), []
    for path in np.linspace(0.7 * PATH, PATH, 12):
        arc = face * np.arange(1 + round(path / face))
        k = np.arange(arc.size - 1) + 0.5
        ringing = 0.05 * np.exp(-k / rise) * np.sin(k / rise) - np.exp(-((k / rise) ** 2))
        p = pressure((arc[1:] - 0.5 * face) / path) * (1.0 + ringing)
        rows.append(measure_profile(arc, p * (1.0 + noise * random.normal(size=p.size)), path))
    return np.array(rows)


def flat_and_falling(end):
    return lambda part: 40e9 * (1.0 - np.clip(1.2 * (part - end), 0.0, 0.4))


@pytest.mark.parametrize("rise", [1.0, 4.0])
@pytest.mark.parametrize("end", [0.2, 0.35])
def test_a_plateau_is_found_between_the_rise_and_the_fall(end, rise):
    """Faces of the rise are left out however many they are, and so are those of the fall."""
    found = find_plateau(make_profiles(flat_and_falling(end), face=1e-4, rise=rise))
    assert found.flat
    assert found.p == pytest.approx(40e9, rel=2e-3)
    assert found.end == pytest.approx(end, abs=0.06)
    assert found.start >= rise * 1e-4 / PATH


def test_the_scatter_is_that_of_the_data():
    """Noise on single faces: less of it on the parts, which are several faces long."""
    found = [
        find_plateau(make_profiles(flat_and_falling(0.3), face=1e-4, noise=noise))
        for noise in (0.0, 0.01, 0.02)
    ]
    assert all(plateau.flat for plateau in found)
    assert found[0].scatter < 2e-3
    assert 0.2 * 0.02 < found[2].scatter < 0.8 * 0.02
    assert found[2].scatter == pytest.approx(2.0 * found[1].scatter, rel=0.2)
    assert found[2].p == pytest.approx(40e9, rel=5e-3)


def test_without_a_plateau_the_fall_is_continued_to_the_contact_point():
    """The mean of the faces behind the rise would be 6 % low."""
    profiles = make_profiles(lambda part: 70e9 * (1.0 - 1.5 * part), face=1e-4)
    assert np.nanmean(profiles[:, :5]) < 0.95 * 70e9
    found = find_plateau(profiles, mach=0.85)
    assert not found.flat
    assert found.p == pytest.approx(70e9, rel=5e-3)
    assert "no plateau" in describe_plateau(found)


def test_too_few_faces_give_no_pressure():
    assert find_plateau(make_profiles(flat_and_falling(0.3), face=2e-3)) == NOTHING
    assert find_plateau(np.full((5, len(COLUMNS)), math.nan)) == NOTHING
    assert "take more `cells`" in describe_plateau(NOTHING)


def test_profiles_are_means_over_parts_of_the_path():
    """A pressure linear in the distance: each part has that of its middle, on graded faces too."""
    arc = PATH * np.linspace(0.0, 1.0, 60) ** 1.5
    p = 50e9 - 1e12 * 0.5 * (arc[1:] + arc[:-1])
    found = measure_profile(arc, p, PATH)
    middle = 0.5e-3 * (np.array(EDGES[1:]) + EDGES[:-1]) * PATH
    known = np.isfinite(found)
    assert known.sum() > 15 and not known[0] and known[4:].all()
    assert found[known] == pytest.approx(50e9 - 1e12 * middle[known], rel=2e-3)


# --- finer cells --------------------------------------------------------------------------------


@pytest.mark.parametrize("counts, lengths", [((49, 33), (30.0, 20.0)), ((97, 65), (12.0, 38.0))])
@pytest.mark.parametrize("refinement", [1.2, 3.0, 8.0])
def test_refined_laws_meet_in_one_short_step(counts, lengths, refinement):
    plain, steps = (
        [length * np.diff(law) for length, law in zip(lengths, laws, strict=True)]
        for laws in (meeting_laws(counts, lengths), meeting_laws(counts, lengths, refinement))
    )
    assert steps[0][-1] == pytest.approx(min(plain[0][-1], plain[1][0]) / refinement)
    assert steps[1][0] == pytest.approx(steps[0][-1])
    for one, length in zip((steps[0][::-1], steps[1]), lengths, strict=True):
        ratio = one[1:] / one[:-1]
        assert ratio.min() > 1.0 - 1e-9 and ratio.max() < RATIO + 1e-9
        assert one.sum() == pytest.approx(length)


def test_without_refinement_the_laws_are_the_grown_ones():
    law = np.empty(49)
    fill_grown_law(20.0 / 32, 30.0, True, law)
    assert np.array_equal(meeting_laws((49, 33), (30.0, 20.0))[0], law)


def test_the_zone_of_constant_states_ends_where_the_flow_behind_is_sonic():
    zones = []
    for below in (0.1, 0.5, 1.0, 3.0):
        problem = make_flying(angle=16.057 - below)
        machs = [wave.mach_behind for wave in (problem.collision.plate, problem.collision.wedge)]
        assert (problem.zone > 0.0) == (min(machs) > 1.0)
        zones.append(problem.zone)
    assert sorted(zones) == zones


def test_cells_at_the_contact_point_are_finer_near_the_critical_angle():
    far, near = make_flying(angle=12.0), make_flying(angle=16.0)
    assert far.refinement == 1.0 and near.refinement == 3.0
    assert 1.0 < make_flying(angle=14.4).refinement < 3.0
    assert make_flying(angle=17.0).refinement == 1.0  # a jet
    assert make_problem(angle=21.6).refinement == 1.0  # driven: goes on behind B
    assert make_flying(angle=12.0, refinement=2.0).refinement == 2.0
    assert make_flying(angle=16.0, refinement=1.0).refinement == 1.0
    rows = [np.diff(problem.make_grids()[0][1, 0]) for problem in (far, near)]
    assert rows[1][0] < 0.5 * rows[0][0]
    assert near.make_grids()[1].shape[1] > 1.5 * far.make_grids()[1].shape[1]


def test_the_screen_says_how_near_it_is_and_what_that_costs():
    assert describe_nearness(make_flying(angle=12.0)) == []
    words = "\n".join(describe_nearness(make_flying(angle=16.0)))
    for part in ("near critical", "Mach 0.88", "3 times finer", "% more cells", "the steps"):
        assert part in words, (part, words)
    assert "0.06 below it: the shocks are attached" in describe_margin(make_flying(angle=16.0))


def test_one_verdict_for_each_case():
    below, past = make_flying(angle=15.0), make_flying(angle=16.2)
    spacing = below.length / below.deck.cells[0]
    verdicts = [
        describe_verdict(problem, lead * spacing)
        for problem in (below, past)
        for lead in (0.0, 2.0)
    ]
    assert "no jet ahead of A, as by theory" in verdicts[0]
    assert "a jet ahead of A, against theory" in verdicts[1]
    assert "by theory a jet ahead of A, too thin to be seen" in verdicts[2]
    assert "a jet ahead of A, as by theory" in verdicts[3]
    for verdict in verdicts[2:]:
        assert "no jet" not in verdict
    assert "not run far enough" in describe_verdict(past, math.nan)


def test_a_run_with_finer_cells_ends_where_the_face_ends():
    assert make_flying(angle=16.0).ends_at_arrival
    assert not make_flying(angle=16.0, until="end").ends_at_arrival
    assert not make_flying(angle=12.0).ends_at_arrival
    assert make_flying(angle=12.0, until="arrival").ends_at_arrival


def test_cautions_where_cells_do_not_resolve_the_flow_at_a():
    critical = math.degrees(make_flying(angle=10.0).critical.angle)
    cells = [80, 24]
    assert make_flying(angle=critical - 3.0, cells=cells).cautions() == []
    (told,) = make_flying(angle=critical - 0.1, cells=cells).cautions()
    assert "up to 5 % low" in told
    assert "cells=[160, 48]" in told
    (told,) = make_flying(angle=critical - 0.3, cells=cells, refinement=1.0).cautions()
    assert "refinement=3" in told
    (told,) = make_flying(angle=critical - 0.3, cells=[24, 8]).cautions()
    assert "never compared" in told
    assert make_flying(angle=critical - 0.1, cells=[160, 48]).cautions() == []
    assert make_flying(angle=critical + 1.0, cells=cells).cautions() == []
