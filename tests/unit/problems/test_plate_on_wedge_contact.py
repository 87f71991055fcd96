"""`plate-on-wedge`: the plateau behind A, the finer cells near the critical angle, the verdict."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from problems.plate_on_wedge.deck import PlateOnWedgeDeck
from problems.plate_on_wedge.plateau import find_plateau, measure_profile
from problems.plate_on_wedge.problem import PlateOnWedge
from regrid.curves import RATIO, meeting_laws

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
    found = find_plateau(make_profiles(flat_and_falling(end), face=1e-4, rise=rise))
    assert found.flat
    assert found.p == pytest.approx(40e9, rel=2e-3)
    assert found.end == pytest.approx(end, abs=0.06)
    assert found.start >= rise * 1e-4 / PATH


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


def test_the_zone_of_constant_states_ends_where_the_flow_behind_is_sonic():
    zones = []
    for below in (0.1, 0.5, 1.0, 3.0):
        problem = make_flying(angle=16.057 - below)
        machs = [wave.mach_behind for wave in (problem.collision.plate, problem.collision.wedge)]
        assert (problem.zone > 0.0) == (min(machs) > 1.0)
        zones.append(problem.zone)
    assert sorted(zones) == zones
