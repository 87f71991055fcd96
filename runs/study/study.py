"""A study: all its points computed, at most once each, and what came out.

The folder of a study:

    study.toml      what is varied: `shockgrid study DIR` goes on
    runs/           a run directory for each point, called by its values
    study.csv       the table
    study.h5        the table as NetCDF-4
    orders.csv      orders of accuracy, where cells are varied
    study.png       the picture
    superseded/     runs of another deck at the same values

The trap: points that are no longer part of a study keep their runs; they are not in the table.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from regrid.errors import BadInput
from runs.deck.reading import read_deck
from runs.engines.engine import open_engine
from runs.engines.protocol import Engine
from runs.inspection.account import count
from runs.store.directory import RunDirectory
from runs.store.files import disk_errors, write_atomically
from runs.study.checking import check_study
from runs.study.computing import (
    Result,
    Work,
    compute_digest,
    compute_point,
    find_state,
    read_result,
    share_processors,
    warm_up,
)
from runs.study.definition import (
    FILE,
    Definition,
    check_same_deck,
    is_study,
    make_definition,
    read_definition,
)
from runs.study.orders import Series, find_refined_key, find_series, write_orders
from runs.study.points import flatten
from runs.study.table import find_names, make_table, write_csv, write_hdf5

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

OWN = {FILE, "runs", "study.csv", "study.h5", "orders.csv", "study.png", "superseded", ".running"}
Tell = Callable[[int, Result, bool], None]  # number of the point, its result, was it there already


class Study:
    """A study in its folder with the results that are there, one a point, None where there is none.

    `table`: arrays by column; `failures`: sentences by run; `orders`: what grids show where cells
    are varied (`refine` names their key where it is not `cells`).
    """

    def __init__(
        self,
        definition: Definition,
        path: Path | str,
        results: Sequence[Result | None],
        refine: str | None = None,
    ):
        self.definition, self.path, self.results = definition, Path(path), list(results)
        self.refined_key = find_refined_key(definition, refine)

    def __repr__(self) -> str:
        done = sum(result is not None for result in self.results)
        runs = f"{done} of {len(self.results)} runs, {len(self.failures)} failed"
        return f"<study in {self.path}: {runs}>"

    @cached_property
    def table(self) -> dict[str, np.ndarray]:
        """Columns (n,) of the n points: what is varied, how runs ended, and all that is measured.

        Units are those of the deck.
        """
        return make_table(self.definition, self.results)

    @property
    def units(self) -> dict[str, str]:
        """Units of columns, as far as the problem says them."""
        units: dict[str, str] = {}
        for result in self.results:
            units |= result.units if result is not None else {}
        return units

    @property
    def failures(self) -> dict[str, str]:
        """The sentence of each run that failed, by the name of its folder."""
        pairs = zip(self.definition.points, self.results, strict=True)
        return {point.name: r.failure for point, r in pairs if r is not None and r.failure}

    @property
    def cautions(self) -> dict[str, list[str]]:
        """Sentences on where not to trust a run, by the name of its folder; only runs with some."""
        pairs = zip(self.definition.points, self.results, strict=True)
        return {point.name: r.cautions for point, r in pairs if r is not None and r.cautions}

    @cached_property
    def orders(self) -> list[Series]:
        """Each quantity over the cells, with its observed order; [] where no cells are varied."""
        if self.refined_key is None:
            return []
        return find_series(self.definition, self.results, self.refined_key)

    @property
    def shown(self) -> list[str]:
        """What is drawn and printed: the study's choice, or the first that the problem has.

        These are its results, else its errors, else its measurements; where cells are varied, its
        errors.  BadInput for a name that is in no run.
        """
        computed, errors, values = find_names(self.results)
        known = [*computed, *errors, *values]
        for name in self.definition.shown:
            if known and name not in known:
                raise BadInput(f"--of {name}: no run has it; there are: {', '.join(known)}")
        first = computed or errors or values
        if self.refined_key is not None and not self.definition.shown:
            first = errors or computed or values
        return list(self.definition.shown) or first[:2]

    def to_xarray(self) -> xarray.Dataset:
        """The table as a data set, dimensions as in study.h5.

        Raises BadInput where xarray or h5netcdf is not installed.
        """
        try:
            import h5netcdf  # noqa: F401 - the engine
            import xarray
        except ImportError as error:
            raise BadInput(
                f"to_xarray needs xarray and h5netcdf, and {error.name} is not installed here: "
                "python -m pip install xarray h5netcdf"
            ) from error
        return xarray.load_dataset(self.path / "study.h5", engine="h5netcdf")

    def plot(self, path: Path | str | None = None) -> Figure:
        """The figure of `shown`, written to `path` where there is one."""
        from runs.study.pictures import Drawn, draw_study, save_figure

        what = self.table, self.units, self.shown, self.refined_key, self.orders
        figure = draw_study(Drawn(self.definition, *what))
        if path is not None:
            save_figure(figure, Path(path), self.definition.to_toml())
        return figure

    def write(self) -> list[Path]:
        """Write the table, the orders and the picture; the paths, of the picture if there is one.

        Raises BadInput where the disk does not take them.
        """
        paths = [self.path / "study.csv", self.path / "study.h5"]
        write_csv(paths[0], self.table)
        write_hdf5(paths[1], self.definition, self.table, self.units)
        if self.orders:
            paths.append(self.path / "orders.csv")
            write_orders(paths[-1], self.orders)
        if any(result is not None and not result.failure for result in self.results):
            paths.append(self.path / "study.png")
            self.plot(paths[-1])
        return paths


def study(
    deck: str | Path,
    vary: Mapping[str, Any] | None = None,
    output: str | Path = "",
    *,
    points: Sequence[Mapping[str, Any]] = (),
    settings: Mapping[str, Any] | None = None,
    shown: Sequence[str] = (),
    jobs: int | None = 1,
    engine: str = "processes",
    refine: str | None = None,
    **keywords: Any,
) -> Study | None:
    """Compute a deck at many points, as `shockgrid study` does, and return the study.

    deck: problem, packaged deck, deck file, study file, or the folder of a study; vary: values by
    key, or words as `--vary` takes them ("1.2:3:7"), their product is computed; points: instead of
    it; settings, or keywords as for `run` (cells=32): keys for all points; output: the folder, made
    if need be; shown: quantities of the picture; jobs, engine: as `open_engine` takes them (with
    several jobs a script calls this under `if __name__ == "__main__":`).

    None on the ranks of MPI that only compute.  Raises BadInput for what cannot be a study; runs
    that fail are in `Study.failures`.  KeyboardInterrupt where it was stopped; it can be gone on
    with.
    """
    file = is_study(str(deck))
    if file is not None:
        if vary or points or settings or keywords:
            raise BadInput(f"{deck} is a study already; leave vary, points and settings out")
        definition = read_definition(file)
        output = output or (file.parent if Path(deck).is_dir() else "")
    else:
        fixed = flatten({**(settings or {}), **keywords})
        definition = make_definition(str(deck), vary, points, fixed, shown)
    if not str(output):
        raise BadInput("study: the output folder is missing; name it with `output` (-o)")
    with open_engine(engine, jobs) as opened:
        if opened is None:
            return None
        check_study(definition, refine)
        results: list[Result | None] = []
        try:
            with claim_folder(output, definition) as folder:
                compute_results(definition, folder, opened, results=results)
        except KeyboardInterrupt:
            left = sum(result is None for result in results)
            words = f"stopped with {count(left, 'run')} to do; study({str(output)!r}) goes on"
            raise KeyboardInterrupt(words) from None
        made = Study(definition, folder, results, refine)
        made.write()
        return made


@contextlib.contextmanager
def claim_folder(path: str | Path, definition: Definition) -> Iterator[Path]:
    """The folder of a study, made and held for this process, with its study.toml.

    BadInput where something else lies in it, or a study of another deck, or another study runs
    there.
    """
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"{folder} is a file, a study needs a folder; choose another with -o")
    with disk_errors(folder):
        (folder / "runs").parent.mkdir(parents=True, exist_ok=True)
        strange = sorted(p.name for p in folder.iterdir() if p.name not in OWN)
        if strange and not (folder / FILE).exists():
            raise BadInput(
                f"the output folder {folder} holds something else ({', '.join(strange[:4])}); "
                "choose another with -o"
            )
    with RunDirectory(folder).claimed():
        check_same_deck(folder, definition)
        with disk_errors(folder):
            (folder / "runs").mkdir(exist_ok=True)
        write_atomically(folder / FILE, definition.to_toml())
        yield folder


def compute_results(
    definition: Definition,
    folder: Path,
    engine: Engine,
    tell: Tell = lambda number, result, there: None,
    retry: bool = False,
    results: list[Result | None] | None = None,
) -> list[Result | None]:
    """All results, those that are there and those that are not yet; one a point.

    `tell` hears of each; `retry`: failed runs go on from where they failed; `results`: a list to
    fill, for a caller who wants what there is when this ends early.  Raises KeyboardInterrupt where
    a signal stopped a run.
    """
    results = [] if results is None else results
    results[:] = [None] * len(definition.points)
    works: dict[int, Work] = {}
    for number in range(len(definition.points)):
        work = make_work(definition, number, folder, share_processors(engine.workers), retry)
        try:
            digest = compute_digest(read_deck(work.source, work.settings))
        except BadInput as error:
            wrong = Result(digest="", failure=str(error))
            results[number] = wrong
            tell(number, wrong, False)
            continue
        known = read_result(work.folder, digest)
        if known is not None and not (known.failure and retry):
            results[number] = known
            tell(number, known, True)
        else:
            works[number] = work
    if len(works) > 1 and engine.workers > 1:
        _compile_kernels(definition, list(works.items()), engine)
    numbers = list(works)
    for place, found in engine.compute(compute_point, list(works.values())):
        number = numbers[place]
        if isinstance(found, Exception):
            found = Result(digest="", failure=describe_error(found))
        if found.stopped:
            raise KeyboardInterrupt(found.reason)
        results[number] = found
        tell(number, found, False)
    return results


def make_work(
    definition: Definition,
    number: int,
    folder: Path,
    threads: int | None = None,
    retry: bool = False,
) -> Work:
    """What a worker needs for a point, all paths in full."""
    point = definition.points[number]
    source = Path(definition.source)
    return Work(
        str(source.resolve()) if source.is_file() else definition.source,
        (*definition.settings, *point.settings),
        str((folder / "runs" / point.name).resolve()),
        threads,
        retry,
    )


def describe_error(error: Exception) -> str:
    """A sentence for what a worker raised."""
    if isinstance(error, BadInput):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory; fewer cells or fewer jobs need less"
    if type(error).__module__.startswith(("runs.", "distributed")):  # a worker died
        return str(error)
    return f"a mistake in shockgrid itself ({type(error).__name__}: {error})"


def _compile_kernels(definition: Definition, works: list[tuple[int, Work]], engine: Engine) -> None:
    """One step of one point of each kind, so that not every worker compiles the same kernels.

    Kernels are made for materials, limiters and the like: for what is not a number in a deck.
    """
    kinds: dict[tuple, Work] = {}
    for number, work in works:
        values = definition.points[number].values
        kinds.setdefault(tuple(str(v) for _, v in values if not isinstance(v, int | float)), work)
    for _ in engine.compute(warm_up, list(kinds.values())):
        pass  # what is wrong with a point is told where it is computed


def describe_states(definition: Definition, folder: Path) -> list[str]:
    """What is there of each point: "done", "failed", "half", "other", "new", or a sentence."""
    states = []
    for number in range(len(definition.points)):
        work = make_work(definition, number, folder)
        try:
            digest = compute_digest(read_deck(work.source, work.settings))
        except BadInput as error:
            states.append(str(error))
            continue
        states.append(find_state(work.folder, digest))
    return states


@contextlib.contextmanager
def terminate_softly() -> Iterator[list[int]]:
    """In the block SIGTERM is a KeyboardInterrupt; the list then holds its number."""
    caught: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield caught
        return

    def stop(number, frame):
        caught.append(number)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield caught
    finally:
        signal.signal(signal.SIGTERM, before)
