"""SESAME files: read, refused with a sentence, and made into tables that the flow can use."""

from __future__ import annotations

import numpy as np
import pytest

from shockgrid.hydro.eos import MieGruneisen, Tabular
from shockgrid.hydro.eos.sesame import make_pressure_table, read_sesame
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.inspection.sesame import convert, describe_file

LAW = MieGruneisen(8930.0, 3940.0, 1.489, 2.0).with_heat_capacity(385.0)
DENSITIES = np.concatenate([[0.0], np.linspace(8600.0, 13000.0, 45)])
TEMPERATURES = np.concatenate([[0.0], np.geomspace(100.0, 20000.0, 24)])


def write_words(words, width):
    """Words as a file has them, five to a line."""
    digits = width - 7
    texts = [f"{word:{width}.{digits}E}" for word in words]
    return "\n".join("".join(texts[k : k + 5]) for k in range(0, len(texts), 5)) + "\n"


def write_file(path, width=22, number=3336):
    """A file with the states of LAW over density and temperature."""
    n, m = DENSITIES.size, TEMPERATURES.size
    rho = np.broadcast_to(np.maximum(DENSITIES, 8600.0)[:, None], (n, m))
    cold = LAW.temperature(rho, np.zeros(rho.shape))
    energy = (TEMPERATURES - cold) * LAW.heat_capacity
    pressure = LAW.pressure(rho, energy)
    general = [29.0, 63.546, 8.93, 137.0, 0.0]
    total = [n, m, *DENSITIES / 1e3, *TEMPERATURES, *(pressure.T / 1e9).ravel()]
    total += [*(energy.T / 1e6).ravel()]
    comment = "copper, of a known law"
    text = f" 0 {number}  101 {len(comment)} r 1 1 1\n{comment}\n"
    text += f" 1 {number}  201    5 r 1 1 1\n{write_words(general, width)}"
    text += f" 1 {number}  301 {len(total)} r 1 1 1\n{write_words(total, width)} 2\n"
    path.write_text(text)
    return path


@pytest.mark.parametrize(("width", "exact"), [(22, 1e-13), (15, 1e-6)])
def test_a_file_gives_back_the_law_that_it_was_made_of(tmp_path, width, exact):
    table = read_sesame(write_file(tmp_path / "law.ses", width))[3336]
    assert table.rho0 == pytest.approx(8930.0)
    rho = np.broadcast_to(table.density[1:, None], table.pressure[1:].shape)
    wanted = LAW.pressure(rho, table.energy[1:])
    assert np.abs(table.pressure[1:] - wanted).max() <= 2.0 * exact * np.abs(wanted).max()
    found = LAW.temperature(rho, table.energy[1:])
    assert np.abs(found - table.temperature).max() <= 3.0 * exact * 20000.0


def test_a_made_table_is_the_law_and_its_own_inverse(tmp_path):
    path = write_file(tmp_path / "law.ses")
    told = convert(path, 3336, tmp_path / "law.h5")
    assert 'eos = "tabular"' in told and "left out" not in told
    eos = Tabular(str(tmp_path / "law.h5"))
    random = np.random.default_rng(1)
    rho = random.uniform(8700.0, 12900.0, 400)
    e = random.uniform(0.0, 2e6, 400)
    p = eos.pressure(rho, e)
    stiffness = LAW.rho0 * LAW.c0**2
    assert np.abs(p - LAW.pressure(rho, e)).max() < 2e-3 * stiffness, "bilinear, 45 densities"
    assert np.abs(eos.energy(rho, p) - e).max() < 1e-10 * LAW.c0**2
    assert (eos.sound_speed(rho, p) > 0.0).all()


def test_states_beneath_the_coldest_go_on_with_the_slope_there(tmp_path):
    made = make_pressure_table(read_sesame(write_file(tmp_path / "law.ses"))[3336])
    rho = np.broadcast_to(made.rho[:, None], made.p.shape)
    wanted = LAW.pressure(rho, np.broadcast_to(made.e, made.p.shape))
    assert np.abs(made.p - wanted).max() < 1e-9 * LAW.rho0 * LAW.c0**2, "linear in e throughout"


def test_densities_where_the_pressure_falls_are_left_out(tmp_path):
    table = read_sesame(write_file(tmp_path / "law.ses"))[3336]
    table.pressure[3] = table.pressure[2] - 5e9
    made = make_pressure_table(table)
    assert made.rho[0] == pytest.approx(table.density[3])


def test_files_that_are_none_are_refused_with_the_line(tmp_path):
    path = write_file(tmp_path / "law.ses")
    lines = path.read_text().splitlines()
    for changed, said in (
        (["hello"], "line 1: 'hello' does not begin a record"),
        (lines[:-9], "record 301 of material 3336 is cut off"),
        (lines[:2] + lines[4:], "has no record 201"),
        ([line.replace("8.93", "8,93") if k == 3 else line for k, line in enumerate(lines)],
         "is no number"),
        ([], "no record of a SESAME table"),
    ):  # fmt: skip
        path.write_text("\n".join([*changed, ""]))
        with pytest.raises(BadInput, match=said):
            read_sesame(path)
    write_file(path)
    with pytest.raises(BadInput, match="no material 7150"):
        convert(path, 7150, tmp_path / "law.h5")
    assert "3336" in describe_file(path)
