"""Tables in the form of the SESAME library, and tables of p(rho, e) made of them.

An ASCII file has records of words, five to a line of 15 or 22 characters each, after a line
"flag material record words ...".  Record 201 tells the density at rest, 301 has pressure and energy
over density and temperature, in Mg/m³, K, GPa and MJ/kg, density running first [LyonJohnson1992].
Here all is in SI units.

The flow wants p(rho, e), rising along both.  At each density energies are brought into order with
temperature, and p is taken linear in e between the table's states; beneath the coldest of them it
goes on with the slope of the first two.  Densities below which p does not rise with the density, as
where liquid and vapour are together, are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.text_files import read_text

WORDS_A_LINE = 5
COMMENT_CHARACTERS = 80  # of a comment in a line
WORD_WIDTHS = (15, 22)  # characters of single and of double precision
GENERAL_RECORD = 201
TOTAL_RECORD = 301
COMMENT_RECORDS = range(100, 200)
DENSITY_UNIT = 1e3  # kg/m³ in Mg/m³
PRESSURE_UNIT = 1e9  # Pa in GPa
ENERGY_UNIT = 1e6  # J/kg in MJ/kg
POINTS_BETWEEN = 4  # energies of the made table for each temperature of the file


@dataclass(frozen=True)
class SesameTable:
    """A material of a file: number, density at rest rho0, and its states.

    density (n,), temperature (m,), pressure and energy (n, m), in SI units.
    """

    number: int
    rho0: float
    density: np.ndarray
    temperature: np.ndarray
    pressure: np.ndarray
    energy: np.ndarray


@dataclass(frozen=True)
class PressureTable:
    """p and T (n, m) over rho (n,) and e (m,), in SI units, as `hydro.eos.tabular` wants them."""

    rho: np.ndarray
    e: np.ndarray
    p: np.ndarray
    temperature: np.ndarray


def read_sesame(path: str | Path) -> dict[int, SesameTable]:
    """The materials of an ASCII file by their numbers.

    Raises BadInput, with the line, for a file that is none or is cut off, and for a material
    without record 201 or 301.
    """
    try:
        lines = read_text(path).splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: it cannot be read: {error}") from None
    records: dict[int, dict[int, np.ndarray]] = {}
    at = 0
    while at < len(lines) and lines[at].split() and lines[at].split()[0] != "2":
        at, material, record, words = _read_record(path, lines, at)
        tables = records.setdefault(material, {})
        if words is not None:
            tables[record] = words
    if not records:
        raise BadInput(f"{path}: there is no record of a SESAME table in it")
    return {number: _make_table(path, number, tables) for number, tables in records.items()}


def _read_record(
    path: str | Path, lines: list[str], at: int
) -> tuple[int, int, int, np.ndarray | None]:
    """The line after a record that begins at line `at`; material, record and words, if numbers."""
    try:
        material, record, count = (int(word) for word in lines[at].split()[1:4])
    except ValueError:
        raise BadInput(
            f"{path}, line {at + 1}: {lines[at][:40]!r} does not begin a record of a SESAME table: "
            "a flag, the numbers of material and record, and how many words follow"
        ) from None
    at += 1
    if record in COMMENT_RECORDS:
        return at + -(-count // COMMENT_CHARACTERS), material, record, None
    rows = -(-count // WORDS_A_LINE)
    if at + rows > len(lines):
        raise BadInput(f"{path}: record {record} of material {material} is cut off")
    width = WORD_WIDTHS[len(lines[at].rstrip()) >= WORDS_A_LINE * WORD_WIDTHS[1]]
    text = "".join(
        line[: WORDS_A_LINE * width].ljust(WORDS_A_LINE * width) for line in lines[at : at + rows]
    )
    words = np.empty(count)
    for k in range(count):
        word = text[k * width : (k + 1) * width].strip()
        try:
            words[k] = float(_restore_exponent(word))
        except ValueError:
            raise BadInput(
                f"{path}, line {at + k // WORDS_A_LINE + 1}: {word!r} is no number"
            ) from None
    return at + rows, material, record, words


def _restore_exponent(word: str) -> str:
    """1.5-100 as 1.5e-100: three digits leave no room for the letter."""
    if len(word) > 4 and word[-4] in "+-" and word[-5] not in "eE":
        return f"{word[:-4]}e{word[-4:]}"
    return word


def _make_table(path: str | Path, number: int, records: dict[int, np.ndarray]) -> SesameTable:
    for record in (GENERAL_RECORD, TOTAL_RECORD):
        if record not in records:
            raise BadInput(f"{path}: material {number} has no record {record}")
    words = records[TOTAL_RECORD]
    n, m = (int(word) for word in words[:2])
    if min(n, m) < 2 or words.size < 2 + n + m + 2 * n * m:
        raise BadInput(
            f"{path}: record {TOTAL_RECORD} of material {number} has {words.size} words, too few "
            f"for {n} densities and {m} temperatures"
        )
    density, temperature, pressure, energy = np.split(
        words[2 : 2 + n + m + 2 * n * m], np.cumsum([n, m, n * m])
    )
    return SesameTable(
        number,
        float(records[GENERAL_RECORD][2]) * DENSITY_UNIT,
        density * DENSITY_UNIT,
        temperature,
        pressure.reshape(m, n).T * PRESSURE_UNIT,
        energy.reshape(m, n).T * ENERGY_UNIT,
    )


def make_pressure_table(table: SesameTable) -> PressureTable:
    """A table of p(rho, e) of all densities at which p rises along both.

    Raises BadInput where energy does not rise with temperature, and where no density is left.
    """
    solid = table.density > 0.0
    rho = table.density[solid]
    energy = table.energy[solid]
    pressure = table.pressure[solid]
    rising = np.diff(energy, axis=1) > 0.0
    if not rising.all():
        i, j = (int(k) for k in np.argwhere(~rising)[0])
        raise BadInput(
            f"material {table.number}: at rho = {rho[i]:g} kg/m3 the energy does not rise from "
            f"{table.temperature[j]:g} to {table.temperature[j + 1]:g} K"
        )
    e = choose_energies(table.rho0, rho, energy)
    p = np.array([follow_line(e, *row) for row in zip(energy, pressure, strict=True)])
    t = np.array([follow_line(e, row, table.temperature) for row in energy])
    first = find_first_rising(p)
    if first > rho.size - 2:
        raise BadInput(
            f"material {table.number}: the pressure does not rise with density and energy at any "
            "two densities"
        )
    return PressureTable(rho[first:], e, p[first:], t[first:])


def choose_energies(rho0: float, rho: np.ndarray, energy: np.ndarray) -> np.ndarray:
    """Energies (m,) from the least of the table up to the greatest at the density at rest."""
    row = energy[int(np.argmin(np.abs(rho - rho0)))]
    steps = np.arange(POINTS_BETWEEN) / POINTS_BETWEEN
    fine = (row[:-1, None] + steps * np.diff(row)[:, None]).ravel()
    least = energy.min()
    below = np.arange(row[0], least, -(fine[1] - fine[0]))[1:]
    count = min(below.size, POINTS_BETWEEN * row.size)
    below = np.linspace(least, row[0], count + 1)[:-1] if count else below
    return np.concatenate([below, fine, row[-1:]])


def follow_line(at: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """y at the places `at` of the polyline through (x, y), whose first and last piece go on."""
    piece = np.clip(np.searchsorted(x, at, side="right") - 1, 0, x.size - 2)
    fraction = (at - x[piece]) / (x[piece + 1] - x[piece])
    return y[piece] + fraction * (y[piece + 1] - y[piece])


def find_first_rising(p: np.ndarray) -> int:
    """The first row from which on p (n, m) rises along both axes up to the last row."""
    is_rising = (np.diff(p, axis=1) > 0.0).all(axis=1)
    is_rising[:-1] &= (np.diff(p, axis=0) > 0.0).all(axis=1)
    not_rising = np.flatnonzero(~is_rising)
    return int(not_rising[-1]) + 1 if not_rising.size else 0
