"""SESAME files at the command line: what is in them, and tables of p(rho, e) made of them."""

from __future__ import annotations

import io
from pathlib import Path

import h5py

from shockgrid.hydro.eos.sesame import PressureTable, SesameTable, make_pressure_table, read_sesame
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.store.files import write_atomically

ENDINGS = (".ses", ".sesame", ".asc")


def split_name(name: str) -> tuple[Path, int | None] | None:
    """File and number of "FILE.ses" or "FILE.ses:NUMBER"; None for another name."""
    file, colon, number = name.rpartition(":")
    if colon and Path(file).suffix.lower() in ENDINGS:
        if not number.isdigit():
            raise BadInput(f"{name!r}: after the file stands the number of a material, {file}:3336")
        return Path(file), int(number)
    return (Path(name), None) if Path(name).suffix.lower() in ENDINGS else None


def describe_file(path: Path) -> str:
    """A line for each material of a file."""
    lines = [f"{'material':>10}{'density at rest':>20}   densities and temperatures of the table"]
    for number, table in read_sesame(path).items():
        span = (
            f"{table.density[0]:g} to {table.density[-1]:g} kg/m3 ({table.density.size}), "
            f"{table.temperature[0]:g} to {table.temperature[-1]:g} K ({table.temperature.size})"
        )
        lines.append(f"{number:>10}{f'{table.rho0:g} kg/m3':>20}   {span}")
    usage = f'shockgrid materials {path}:NUMBER -o FILE.h5: a table for eos = "tabular"'
    return "\n".join([*lines, "", usage])


def convert(path: Path, number: int, output: Path) -> str:
    """Write a material's table of p(rho, e) and tell its limits, and how a deck names it."""
    tables = read_sesame(path)
    if number not in tables:
        known = ", ".join(str(one) for one in tables)
        raise BadInput(f"{path}: there is no material {number} in it; there are: {known}")
    table = tables[number]
    made = make_pressure_table(table)
    write_atomically(output, make_image(made))
    return (
        f"{output}: p(rho, e) of material {number}, rho {made.rho[0]:g} to {made.rho[-1]:g} kg/m3, "
        f"e {made.e[0]:g} to {made.e[-1]:g} J/kg, p {made.p.min():.4g} to {made.p.max():.4g} Pa"
        f"{say_left_out(table, made)}\n\n"
        "in a file of materials, such as my.toml, named my.toml:mine in a deck:\n\n"
        f'[mine]\neos = "tabular"\nsource = "{path.name}, material {number}"\n'
        f'path = "{output.name}"\nrho0 = {table.rho0:g}'
    )


def say_left_out(table: SesameTable, made: PressureTable) -> str:
    """The sentence about densities of the file that the made table does not have."""
    left = table.density[(table.density > 0.0) & (table.density < made.rho[0])]
    if not left.size:
        return ""
    return (
        f"\nleft out: the {left.size} densities below {made.rho[0]:g} kg/m3, where the pressure "
        "does not rise with density and energy"
    )


def make_image(made: PressureTable) -> bytes:
    """An HDF5 file with the datasets rho, e, p and T."""
    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        datasets = {"rho": made.rho, "e": made.e, "p": made.p, "T": made.temperature}
        units = {"rho": "kg/m3", "e": "J/kg", "p": "Pa", "T": "K"}
        for name, values in datasets.items():
            file.create_dataset(name, data=values).attrs["units"] = units[name]
    return image.getvalue()
