"""Marches as files: .npz, or .h5 with the same names; the format stands in README.md."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import h5py
import numpy as np

from regrid_suite.marches import March, name_sides
from shockgrid.regrid.errors import BadInput

FORMAT = "regrid-march 1"
WORDS = ("name", "about", "formula")
ENDINGS = (".npz", ".h5")


def write_march(march: March, path: Path) -> Path:
    """Write a march under a name that ends in .npz or .h5; the file is there whole or not at all.

    Raises BadInput for another ending.
    """
    if path.suffix not in ENDINGS:
        raise BadInput(f"{path}: a march is written to a file that ends in {' or '.join(ENDINGS)}")
    arrays = {"start": march.start, "parameter": march.parameter, **march.sides}
    if march.sound is not None:
        arrays["sound"] = march.sound
    words = {"format": FORMAT, "deforming": " ".join(march.deforming)}
    words |= {word: getattr(march, word) for word in WORDS}
    unfinished = path.with_name(f".{path.stem}.unfinished{path.suffix}")
    if path.suffix == ".npz":
        np.savez_compressed(unfinished, **arrays, **{k: np.array(v) for k, v in words.items()})
    else:
        with h5py.File(unfinished, "w") as file:
            file.attrs.update(words)
            for name, array in arrays.items():
                file.create_dataset(name, data=array, compression="gzip")
    os.replace(unfinished, path)
    return path


def read_march(path: Path) -> March:
    """The march in a file; BadInput where the file is none, or its arrays do not fit each other."""
    try:
        if path.suffix == ".h5":
            with h5py.File(path) as file:
                found = {name: data[()] for name, data in file.items()} | dict(file.attrs)
        else:
            with zipfile.ZipFile(path), np.load(path, allow_pickle=False) as file:
                found = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise BadInput(f"{path}: not a march in a file .npz or .h5 ({error})") from None
    if str(found.get("format")) != FORMAT:
        raise BadInput(
            f"{path}: 'format' is {str(found.get('format', 'missing'))!r}; it has to be {FORMAT!r}"
        )
    missing = {"start", "parameter", "deforming", *WORDS} - found.keys()
    if missing:
        raise BadInput(f"{path}: a march has to have {', '.join(sorted(missing))}, too")
    start = np.ascontiguousarray(found["start"], dtype=float)
    if start.ndim not in (3, 4) or len(start) != start.ndim - 1:
        raise BadInput(
            f"{path}: start has shape {start.shape}; it has to be (2, ni+1, nj+1) or "
            "(3, ni+1, nj+1, nk+1)"
        )
    parameter = np.asarray(found["parameter"], dtype=float)
    sides = {}
    for side in name_sides(len(start)):
        axis = "ijk".index(side[0]) + 1
        wanted = (len(parameter), *(n for k, n in enumerate(start.shape) if k != axis))
        if side not in found or found[side].shape != wanted:
            shape = found[side].shape if side in found else "missing"
            raise BadInput(f"{path}: {side} is {shape}; it has to have the shape {wanted}")
        sides[side] = np.asarray(found[side], dtype=float)
    return March(
        **{word: str(found[word]) for word in WORDS},
        start=start,
        sides=sides,
        parameter=parameter,
        deforming=tuple(str(found["deforming"]).split()),
        sound=np.asarray(found["sound"], dtype=float) if "sound" in found else None,
    )
