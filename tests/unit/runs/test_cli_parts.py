"""Pieces under the command line, each alone: values of --set, history lines, units, interfaces."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from builders import ROOT, box
from regrid.errors import BadInput
from runs.deck.reading import apply_setting, parse_value, resolve_deck
from runs.inspection.account import describe_convexity, describe_seconds, measure_drifts
from runs.inspection.units import pick_prefix
from runs.pictures.outlines import split_outline
from runs.store.history import HistoryWriter, read_history, truncate_history


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
    with pytest.raises(BadInput, match="no place in a list of 2"):
        apply_setting(table, "modes.2.n=5")
    with pytest.raises(BadInput, match=r"run\.t_end is a value, not a table"):
        apply_setting(table, "run.t_end.x=5")


def test_settings_reach_into_the_default_list():
    table = {"problem": "interface-instability"}
    deck = resolve_deck(table, "deck", ("modes.0.ka0=0.3",)).deck
    assert [mode.ka0 for mode in deck.modes] == [0.3]
    own = {"problem": "interface-instability", "modes": [{"ka0": 0.1}, {"number": 2}]}
    deck = resolve_deck(own, "deck", ("modes.1.ka0=0.3",)).deck
    assert [(mode.number, mode.ka0) for mode in deck.modes] == [(1, 0.1), (2, 0.3)]
    with pytest.raises(BadInput, match="no place in a list of 1"):
        resolve_deck({"problem": "interface-instability"}, "deck", ("modes.1.ka0=0.3",))


def test_number_where_text_is_wanted():
    assert resolve_deck({"problem": "riemann"}, "deck", ("case=123",)).deck.case == "123"
    with pytest.raises(BadInput, match=r"run\.cfl = true"):
        resolve_deck({"problem": "riemann"}, "deck", ("run.cfl=true",))


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


@pytest.mark.parametrize("cut", range(1, 40))
def test_history_cut_anywhere_keeps_its_whole_rows(tmp_path, cut):
    path = tmp_path / "h.csv"
    write_rows(path, 6)
    content = path.read_bytes()[:-cut]
    path.write_bytes(content)
    history = read_history(path)
    assert len(history["step"]) == content.count(b"\n") - 1
    step = int(history["step"][-1])
    assert truncate_history(path, step - 1) == list(history)
    assert read_history(path)["step"][-1] == step - 1
    with pytest.raises(BadInput, match="before the restart point"):
        truncate_history(path, step)


def test_history_columns_may_not_change(tmp_path):
    writer = HistoryWriter(tmp_path / "h.csv")
    writer.append({"step": 1, "t": 0.1})
    with pytest.raises(BadInput, match="new"):
        writer.append({"step": 2, "t": 0.1, "new": 3})
    writer.close()


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


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (1.25e-5, "s", "12.5 µs"),
        (0.0, "s", "0 s"),
        (5e9, "Pa", "5 GPa"),
        (1e-3, "m", "1 mm"),
        (2700.0, "kg/m3", "2700 kg/m3"),
        (0.5, "1", "0.5"),
        (999.9999999, "m", "1 km"),
    ],
)
def test_units(value, unit, words):
    factor, name = pick_prefix(value, unit)
    assert f"{value * factor:.4g} {name}".rstrip() == words
    assert pick_prefix(math.nan, unit)[0] == 1.0


def test_describe_seconds():
    assert [describe_seconds(s) for s in (0.0123, 12.34, 240, 36000)] == [
        "0.012 s",
        "12.3 s",
        "4 min 0 s",
        "10 h 0 min",
    ]


def make_block(material, x0, x1, y0=0.0, y1=1.0, bend=0.0, n=8):
    x, y = box((x0, y0), (x1, y1), (n, n))
    return SimpleNamespace(name=material, material=material, nodes=np.array([x + bend * y * y, y]))


def test_interface_between_materials_and_no_seam():
    blocks = [make_block("a", 0, 1), make_block("a", 1, 2), make_block("b", 2, 3)]
    interfaces, outer = split_outline(blocks)
    assert len(interfaces) == 1
    np.testing.assert_allclose(interfaces[0][0], 2.0)
    assert len(outer) == 8 and not any((line[0] == 1.0).all() for line in outer)


def test_interface_of_nodes_that_do_not_match():
    blocks = [make_block("a", 0, 1, bend=0.3), make_block("b", 1, 2, bend=0.3, n=11)]
    interfaces, _ = split_outline(blocks)
    assert len(interfaces) == 1 and interfaces[0].shape[1] == 9
    partly = [make_block("a", 0, 1), make_block("b", 1, 2, y0=0.5, y1=1.5)]
    interfaces, _ = split_outline(partly)
    assert interfaces[0][1].min() == 0.5 and interfaces[0][1].max() == 1.0


def test_cells_that_are_not_convex_are_told():
    t = np.array([0.0, 1.0, 2.0, 3.0])
    bad = {"t": t, "cells_not_convex": np.array([np.nan, 0.0, 2.0, 1.0])}
    assert describe_convexity(bad) == (
        "NOT CONVEX: in 2 steps of 4, first at t = 2 s, at most 2 cells"
    )
    assert describe_convexity(bad | {"cells_not_convex": 0.0 * t}) == (
        "every cell convex in every step"
    )
    flat = {"t": t, "cells_not_convex": 0.0 * t, "cells_triangular": np.array([0, 0, 1, 2.0])}
    assert describe_convexity(flat) == (
        "every cell convex in every step; at corners of blocks 2 triangles at most, "
        "in 2 steps, first at t = 2 s"
    )
    older = {"t": t, "least_scaled_jacobian": np.array([0.2, 0.1, 0.1, -0.1])}
    assert describe_convexity(older) == "NOT CONVEX: in 1 step of 4, first at t = 3 s"
    assert describe_convexity({"t": t}) == ""


def test_whoever_waits_for_kernels_is_told_again(monkeypatch):
    """And no more once the wait is over; nothing at all when quiet, or where none is compiled."""
    import io
    import time

    import numba

    from runs.march import progress

    monkeypatch.setattr(progress, "PATIENCE", 0.02)
    monkeypatch.setattr(progress, "REMINDER", 0.05)
    said, quiet, loaded = io.StringIO(), io.StringIO(), io.StringIO()
    with progress.patience(False, loaded):
        time.sleep(0.1)
    assert not loaded.getvalue(), "kernels from the disk are not compiled"
    with progress.patience(False, said), progress.patience(True, quiet):
        assert numba.njit(lambda x: 2.0 * x)(1.5) == 3.0
        time.sleep(0.5)
    told = said.getvalue()
    assert told.startswith("compiling kernels") and "still compiling" in told
    time.sleep(0.15)
    assert said.getvalue() == told and not quiet.getvalue()


def test_time_left_is_told_from_the_latter_half_of_the_run(monkeypatch):
    """Neither the first step, which loads kernels, nor longer steps at the start deceive."""
    import io

    from runs.march import progress

    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: clock.now))
    run = SimpleNamespace(blocks=[make_block("a", 0, 1)], t=0.0, t_end=1000.0, step=0)
    bar = progress.Progress(run, stream=io.StringIO())
    clock.now, run.t = 60.0, 1.0  # kernels
    bar.update(run, {})
    assert bar.remaining(run, clock.now) == "?"
    for _ in range(100):  # 4 a second, then 1
        clock.now, run.t = clock.now + 1.5, run.t + 6.0
        bar.update(run, {})
    for _ in range(100):
        clock.now, run.t = clock.now + 1.5, run.t + 1.5
        bar.update(run, {})
    assert run.t == 751.0
    found = bar.left.foretell(bar.steps, run.t, clock.now)
    assert found.low <= 249.0 <= found.high < 2.0 * 249.0 and found.seconds == pytest.approx(
        249.0, 0.1
    )
    assert bar.remaining(run, clock.now).endswith(" min")


@pytest.mark.slow
def test_every_column_of_a_flow_s_history_is_explained():
    from runs.deck.reading import read_deck

    page = (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
    row = read_deck("conical-target", ("cells=16",)).make_problem().build().compute_row("start", 0)
    prefixes = ("total_", "boundary_")
    assert all(f"`{prefix}*`" in page for prefix in prefixes)
    mute = [name for name in row if not name.startswith(prefixes) and f"`{name}`" not in page]
    assert not mute
