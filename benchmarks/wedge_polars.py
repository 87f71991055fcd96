"""Shock polars over the angle: theory beside runs of a moving plate, as plain numbers.

    measure_polar_point(deck)   one angle: the deck's run until A is at B, against theory
    make_angles(deck, below)    decks of one collision, so many degrees below its critical angle

An angle past the critical one has no polar point: there is the jet's verdict only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import msgspec
import numpy as np

from shockgrid.problems.plate_on_wedge.problem import PlateOnWedge, PlateOnWedgeDeck
from shockgrid.problems.plate_on_wedge.report import (
    measure_behind,
    measure_contact_speed,
    measure_lead,
    measure_plateau,
)
from shockgrid.regrid.errors import RunFailure

DIGITS = 6  # of the numbers handed on


def make_angles(deck: PlateOnWedgeDeck, below: Iterable[float]) -> list[PlateOnWedgeDeck]:
    """The deck at angles so many degrees below its critical angle; negative numbers are past it."""
    critical = math.degrees(PlateOnWedge(deck).critical)
    angles = [round(critical - away, 3) for away in below]
    return [msgspec.structs.replace(deck, angle=angle) for angle in angles]


def measure_polar_point(deck: PlateOnWedgeDeck) -> dict:
    """What a run of the deck until A is at B gives beside theory; differences in per cent.

    `failure` has the sentence of a run that died; what it had measured till then stands.
    """
    problem = PlateOnWedge(msgspec.structs.replace(deck, until="arrival"))
    run = problem.build()
    rows = []
    failure = None
    try:
        while not run.finished:
            rows.append(run.advance() | problem.measure(run))
    except RunFailure as error:
        failure = str(error)
    history = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    theory = problem.collision
    behind = measure_behind(problem, history)
    plateau = measure_plateau(problem, history)
    lead = measure_lead(problem, history)
    found = {
        "plate": deck.plate,
        "wedge": deck.wedge,
        "speed": deck.drive.speed,
        "cells": list(deck.cells),
        "angle": deck.angle,
        "critical angle": math.degrees(problem.critical),
        "attached": theory.attached,
        "refinement": problem.refinement,
        "steps": run.step,
        "all cells": sum(block.ni * block.nj for block in run.blocks),
        "failure": failure,
        "contact speed": measure_contact_speed(problem, history)[0],
        "contact speed, theory": theory.contact_speed,
        "lead, mm": 1e3 * lead,
    }
    if theory.attached:
        found |= {
            "p": plateau.p,
            "p, theory": theory.p,
            "error in p, %": 100.0 * (plateau.p / theory.p - 1.0),
            "plateau": plateau.flat,
            "scatter, %": 100.0 * plateau.scatter,
            "zone, theory": problem.zone,
            "plate turns by": math.degrees(behind["theta_plate"]),
            "plate turns by, theory": math.degrees(theory.plate.deflection),
            "mach behind, plate": theory.plate.mach_behind,
            "mach behind, wedge": theory.wedge.mach_behind,
        }
    return {name: _round(value) for name, value in found.items()}


def _round(value):
    """Numbers to DIGITS digits, None for those that are not finite: what JSON can hold."""
    if not isinstance(value, float):
        return value
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
