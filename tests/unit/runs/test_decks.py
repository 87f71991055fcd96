"""Words of the command line, bounds of decks, keys that are not set, units."""

from __future__ import annotations

import math
import re
import tomllib

import msgspec
import numpy as np
import pytest

from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.checking import describe_deck
from shockgrid.runs.deck.reading import apply_setting, parse_value, read_deck
from shockgrid.runs.inspection.account import measure_drifts
from shockgrid.runs.quantities import drop_units
from shockgrid.runs.store.history import HistoryWriter, read_history


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3),
        ("3", 3),
        ("true", True),
        ("[1, 2]", [1, 2]),
        ("air-sf6", "air-sf6"),
        ('"3"', "3"),
        ("{a = 1}", {"a": 1}),
        ("1\nx = 2", "1\nx = 2"),
        ("", ""),
    ],
)
def test_parse_value(text, value):
    parsed = parse_value(text)
    assert parsed == value and type(parsed) is type(value)


def test_apply_setting_reaches_tables_and_lists():
    table = {"modes": [{"n": 1}, {"n": 2}]}
    assert apply_setting(table, "run.t_end=2") == "run.t_end"
    apply_setting(table, "modes.1.n=5")
    assert table == {"modes": [{"n": 1}, {"n": 5}], "run": {"t_end": 2}}
    with pytest.raises(BadInput, match="not an index"):
        apply_setting(table, "modes.2.n=5")
    with pytest.raises(BadInput, match=r"run\.t_end is a value, not a table"):
        apply_setting(table, "run.t_end.x=5")


def write_rows(path, count):
    writer = HistoryWriter(path)
    writer.start({"step": 0, "t": 0.0, "a": 1.5})
    for step in range(1, count + 1):
        row = {"step": step, "t": step / 3, "word": "cfl, sound" if step % 2 else "end"}
        writer.append(row | {"a": math.pi * step, "bad": math.nan, "count": np.int64(step)})
    writer.close()


def test_history_reads_back_to_the_bit(tmp_path):
    write_rows(tmp_path / "h.csv", 4)
    history = read_history(tmp_path / "h.csv")
    assert history["t"].tolist() == [0.0, 1 / 3, 2 / 3, 1.0, 4 / 3]
    assert history["a"].tolist() == [1.5, *(math.pi * k for k in range(1, 5))]
    assert history["word"].tolist() == ["", "cfl; sound", "end", "cfl; sound", "end"]
    assert np.isnan(history["bad"]).all() and history["step"].dtype == np.int64


def test_drift_leaves_out_what_came_through_the_boundary():
    history = {
        "total_energy": np.array([2.0, 3.0, 4.0]),
        "boundary_energy": np.array([0.0, 1.0, 2.0]),
        "total_mass_a": np.array([2.0, 2.0, 2.0]),
        "total_momentum_y": np.array([0.0, 1e-12, 0.0]),
    }
    drifts = measure_drifts(history)
    assert drifts["energy"] == 0.0
    assert drifts["momentum_y"] == pytest.approx(0.25e-12)


NONSENSE = [
    ("noh", "gamma=1.000001"),
    ("noh", "pressure=1000"),
    ("noh", "pressure=1e-12"),
    ("sedov", "pressure=1e6"),
    ("saltzmann", "pressure=1e6"),
    ("oblique-shock", "mach=1e12"),
    ("oblique-shock", "angle=1e-12"),
    ("detonation", "front=1e12"),
    ("detonation", "length=1e-12"),
    ("triple-point", "thickness=1e12"),
    ("rayleigh-taylor", "sound_speed=1e12"),
    ("rayleigh-taylor", "sound_speed=0.5"),
    ("rayleigh-taylor", "amplitude=1e-12"),
    ("free-stream", "mach=1e12"),
    ("free-stream", "angle=1e12"),
    ("shock-bubble", "mach=1.000000001"),
    ("shock-bubble", "thickness=1e12"),
    ("shock-bubble", "gas=argon"),
    ("shock-bubble", "limiter=superbee"),
    ("gresho", "cells=2"),
    ("taylor-green", "amplitude=0.5"),
    ("heated-cavity", "aspect=1e-12"),
    ("heated-cavity", "prandtl=1e12"),
    ("heated-cavity", "tilt=1e12"),
    ("heated-cavity", "left.value=1e12"),
    ("heated-cavity", "tolerance=0.999"),
    ("rayleigh-benard", "width=1e-12"),
    ("rayleigh-benard", "rayleigh=1e300"),
    ("convection-1d", "mean_speed=1e12"),
    ("moving-grid-1d", "viscosity=1e6"),
    ("interface-instability", "mach=1.0000001"),
    ("interface-instability", "gap=1e-6"),
    ("interface-instability", "kct_end=1e9"),
    ("interface-instability", "line.thickness=1e13"),
    ("interface-instability", "modes.0.ka0=50"),
    ("interface-instability", "run.cfl=1e-9"),
    ("interface-instability", "output.every=0"),
    ("interface-instability", "output.precision=half"),
    ("interface-instability", "output.compression=12"),
    ("flyer-target", "plates.1.gap=-1e-4"),
    ("flyer-target", "void_fill.pressure=-1"),
    ("flyer-target", "bond=-1"),
    ("plate-on-wedge", "gap=-1e-3"),
    ("cavity", "void_fill.gamma=1"),
    ("cavity", "before=0.5"),
    ("cavity", "speed=1e6"),
    ("heated-cavity", "cells=2"),
    ("heated-cavity", "cells_up=2"),
    ("heated-cavity", "left.flow=periodic"),
    ("heated-cavity", "grid.kind=polevikof"),
    ("convection-1d", "rayleigh=-1"),
    ("convection-1d", "prandtl=1e-300"),
    ("convection-1d", "mean_speed=nan"),
    ("convection-1d", "grid.ratio=0.5"),
    ("convection-1d", "scheme=centred"),
]


@pytest.mark.parametrize(("problem", "setting"), NONSENSE, ids=" ".join)
def test_values_without_a_meaning_are_refused(problem, setting):
    key = setting.partition("=")[0]
    with pytest.raises(BadInput, match=f"--set: {key} = .*; it must be "):
        read_deck(problem, (setting,))


@pytest.mark.parametrize(
    "name", ["interface-instability-modes", "blocks-gas-gun", "plate-on-wedge", "riemann-captured"]
)
def test_every_key_is_shown_with_its_meaning(name):
    read = read_deck(name, ("run.max_steps=3",))
    text = describe_deck(read.problem, read.deck)
    assert tomllib.loads(text) == tomllib.loads(read.to_toml())
    lines = text.splitlines()
    for k, line in enumerate(lines):
        if re.match(r"[\w[]", line) and line.split(" ")[0] not in ("problem", "kind", "eos"):
            assert "  # " in line or lines[k - 1].startswith("# "), line
    keys = {field.name for field in msgspec.structs.fields(read.deck)} - {"digests"}  # a run's own
    for key in keys:
        assert re.search(rf"^(# )?\[*{key}\b", text, re.MULTILINE), key
    assert "max_steps = 3  " in text and "# t_set_up =  " in text
    assert max(len(line) for line in lines if "= [" not in line) <= 100


def test_a_deck_without_units_is_shown_without_units():
    deck = read_deck("interface-instability", ("first.rho=2",)).deck
    assert "[Pa]" in describe_deck("interface-instability", deck)
    bare = describe_deck("interface-instability", deck, "1")
    assert not re.search(r"\[(m|s|Pa|kg/m3|N/m)\]", bare)
    words = "dt fell to 3e-07 s, x = 1 m, t = 0.2 s (step 3), 2 stages, k c t = 3 [x, y] [m/s]"
    bare = "dt fell to 3e-07, x = 1, t = 0.2 (step 3), 2 stages, k c t = 3 [x, y]"
    assert drop_units(words, "s") == words and drop_units(words, "1") == bare
