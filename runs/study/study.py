"""A study: a deck, or a user's function, at many points; each is computed at most once.

The folder of a study:

    study.toml      the varied keys: `shockgrid study DIR` continues
    runs/           a run directory for each point, named after its values
    study.csv       the table
    orders.csv      orders of accuracy, if cells are varied
    study.png       the picture
    superseded/     runs of another deck at the same values

Note: points that are no longer part of a study keep their runs; they are not in the table.
"""

from __future__ import annotations

import contextlib
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any

import numpy as np

from shockgrid.problems.evolution import get_start_row
from shockgrid.problems.problem import Problem
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.reading import ReadDeck, read_deck
from shockgrid.runs.engines import Engine, open_engine
from shockgrid.runs.quantities import count
from shockgrid.runs.store.directory import RunDirectory
from shockgrid.runs.store.files import disk_errors, make_csv, write_atomically
from shockgrid.runs.store.reader import Table, load_package
from shockgrid.runs.study.computing import (
    Result,
    Work,
    compute_digest_of,
    compute_point,
    fill_numbers,
    find_names,
    find_state,
    read_result,
    share_processors,
    warm_up,
)
from shockgrid.runs.study.definition import (
    FILE,
    Definition,
    check_same_deck,
    flatten,
    is_study,
    make_column,
    make_definition,
    read_definition,
    write_settings,
)
from shockgrid.runs.study.orders import HEADS, Series, find_refined_key, find_series, make_row

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

PICTURE_DPI = 130
OWN = {FILE, "runs", "study.csv", "orders.csv", "study.png", "superseded", ".lock"}
FUNCTION = re.compile(r"[\w.]+:[\w.<>]+")  # module and name


class Study:
    """A study in its folder with its results, one per point, None if there is none yet.

    It prints as its table.  `table`: arrays by column; `failures`: sentences by run; `orders`:
    convergence if cells are varied (`refine` names their key if it is not `cells`).
    """

    def __init__(self, definition: Definition, path: Path | str, refine: str | None = None):
        self.definition = definition
        self.path = Path(path)
        self.results: list[Result | None] = [None] * len(definition.points)
        self.refined_key = find_refined_key(definition, refine)

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        done = sum(result is not None for result in self.results)
        runs = f"{done} of {len(self.results)} runs, {len(self.failures)} failed"
        return "\n".join([f"study in {self.path}: {runs}", *self.make_rows()])

    def make_rows(self) -> list[str]:
        """The first rows of the table: varied keys and shown quantities."""
        columns = list(self.definition.keys)
        for name in self.shown:
            stem = name.removesuffix("_error")
            columns += [stem, f"{stem}_theory", f"{stem}_error", name]
        return self.table.make_rows([c for c in dict.fromkeys(columns) if c in self.table])

    @cached_property
    def table(self) -> Table:
        """Columns (n,) of the n points: varied keys, how runs ended, and all measurements.

        Units are those of the deck.  A result `x` has `x`, `x_theory` and `x_error`.
        """
        points = self.definition.points
        results = self.results
        table = {key: make_column([point[key] for point in points]) for key in self.definition.keys}
        columns = {"run": [point.name for point in points], "state": list(map(_say_state, results))}
        columns["cautions"] = [" | ".join(result.cautions) if result else "" for result in results]
        table |= {name: np.array(column, dtype=str) for name, column in columns.items()}
        for name, kind in (("step", np.int64), ("t", float), ("seconds", float)):
            table[name] = np.array([getattr(r, name) if r else 0 for r in results], dtype=kind)
        for name in dict.fromkeys(name for result in results if result for name in result.values):
            found = [result.values.get(name) if result else None for result in results]
            table.setdefault(name, np.array(found, dtype=float))
        return Table(table, find_units=partial(getattr, self, "units"))

    @property
    def units(self) -> dict[str, str]:
        """Units of columns, as far as the problem defines them."""
        units: dict[str, str] = {}
        for result in self.results:
            units |= result.units if result is not None else {}
        return units

    @property
    def failures(self) -> dict[str, str]:
        """The sentence of each run that failed, by the name of its folder."""
        return {name: r.failure for name, r in self._pairs if r is not None and r.failure}

    @property
    def cautions(self) -> dict[str, list[str]]:
        """Why results of a run may be wrong, by its folder's name; only runs with sentences."""
        return {name: r.cautions for name, r in self._pairs if r is not None and r.cautions}

    @property
    def _pairs(self) -> list[tuple[str, Result | None]]:
        names = (point.name for point in self.definition.points)
        return list(zip(names, self.results, strict=True))

    @cached_property
    def orders(self) -> list[Series]:
        """Each quantity over the cells, with its observed order; [] if no cells are varied."""
        if self.refined_key is None:
            return []
        return find_series(self.definition, self.results, self.refined_key)

    @property
    def shown(self) -> list[str]:
        """Plotted and printed quantities: the study's choice, or the first of the problem's.

        These are its results, else its errors, else its measurements; if cells are varied, its
        errors.  BadInput for a name in no run.
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
        """The table as a data set over the varied keys, or over `point` for listed points.

        Raises BadInput if xarray is not installed.
        """
        xarray = load_package("xarray", "to_xarray")
        vary = self.definition.vary
        scales = {key: make_column(list(values)) for key, values in vary.items()}
        scales = scales or {"point": np.arange(len(self.results))}
        shape = tuple(map(len, scales.values()))
        units = self.units
        data = {
            name: (list(scales), values.reshape(shape), {"units": units.get(name, "1")})
            for name, values in self.table.items()
            if name not in scales
        }
        return xarray.Dataset(data, scales)

    def to_pandas(self) -> Any:
        """The table as a pandas.DataFrame, a row per point; BadInput without pandas."""
        return self.table.to_pandas()

    def plot(self, path: Path | str | None = None) -> Figure:
        """The figure of `shown`, written to `path` if given."""
        from shockgrid.runs.pictures.command import save  # first: it loads matplotlib
        from shockgrid.runs.study.pictures import draw_study

        figure = draw_study(self)
        if path is not None:
            save(figure, Path(path), PICTURE_DPI, self.definition.to_toml())
        return figure

    def write(self, note: Callable[[str], None] = warnings.warn) -> list[Path]:
        """Write the table, the orders and the picture, if there is one; returns their paths.

        note: is told of a picture that cannot be drawn.  Raises BadInput if a file cannot be
        written.
        """
        paths = [self.path / "study.csv"]
        columns = [
            ["" if v != v else repr(v) if isinstance(v, float) else str(v) for v in column.tolist()]
            for column in self.table.values()
        ]
        rows = [list(self.table), *zip(*columns, strict=True)]
        write_atomically(paths[0], make_csv(rows))
        if self.orders:
            paths.append(self.path / "orders.csv")
            write_atomically(paths[-1], make_csv([HEADS, *map(make_row, self.orders)]))
        if any(result is not None and not result.failure for result in self.results):
            try:
                self.plot(picture := self.path / "study.png")
            except Exception as error:  # whatever it is: the numbers are there
                note(f"no picture of the study: {error}")
            else:
                paths.append(picture)
        return paths

    def check(self) -> None:
        """Raise BadInput if no point can be started, or a name of `shown` is in none.

        A value that is wrong at some points makes only these fail.
        """
        if self.definition.function is not None:
            return
        wrong: dict[str, str] = {}
        for number, point in enumerate(self.definition.points):
            try:
                self._read_deck(number).make_problem()
                break
            except BadInput as error:
                wrong[point.name] = str(error)
        else:
            name, sentence = next(iter(wrong.items()))
            head = f"all {len(wrong)} points are wrong; {name}: "
            raise BadInput(head * (len(set(wrong.values())) > 1) + sentence)
        self._check_shown()

    def _read_deck(self, number: int) -> ReadDeck:
        values = {**self.definition.fixed, **self.definition.points[number]}
        return read_deck(self.definition.source, write_settings(values))

    def _check_shown(self) -> None:
        """Raise BadInput for a name of `shown` that no kind of point has initially.

        If a problem's names are unknown before its first step, nothing is refused.
        """
        missing = list(self.definition.shown)
        known = []
        for number in self._find_kinds(range(len(self.results)), float):
            if not missing:
                return
            try:
                deck = self._read_deck(number)
                known += _find_start_names(deck.problem, deck.make_problem())
            except BadInput:
                continue  # it fails by itself
            except Exception:
                return
            missing = [name for name in missing if name not in known]
        if missing:
            choices = f"; there are: {', '.join(dict.fromkeys(known))}" if known else ""
            raise BadInput(f"--of {missing[0]}: no run has it{choices}")

    def _find_kinds(self, numbers: Iterable[int], plain: type | UnionType) -> list[int]:
        """The first point of each kind: points of one kind differ only in `plain` values."""
        kinds: dict[tuple, int] = {}
        for number in numbers:
            values = self.definition.points[number].values()
            kinds.setdefault(tuple(str(v) for v in values if not isinstance(v, plain)), number)
        return list(kinds.values())

    @contextlib.contextmanager
    def claimed(self) -> Iterator[None]:
        """In this context the folder exists with its study.toml and is locked for this process.

        BadInput if it contains something else or a study of another deck, or another study runs
        there.
        """
        folder = self.path
        if folder.exists() and not folder.is_dir():
            raise BadInput(f"{folder} is a file, a study needs a folder; choose another with -o")
        with disk_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            strange = sorted(p.name for p in folder.iterdir() if p.name not in OWN)
            if strange and not (folder / FILE).exists():
                raise BadInput(
                    f"the output folder {folder} holds something else ({', '.join(strange[:4])}); "
                    "choose another with -o"
                )
        with RunDirectory(folder).claimed():
            check_same_deck(folder, self.definition)
            with disk_errors(folder):
                (folder / "runs").mkdir(exist_ok=True)
            write_atomically(folder / FILE, self.definition.to_toml())
            yield

    def run(
        self,
        engine: str | Executor,
        jobs: int | None,
        tell: Callable[[int, Result, bool], None] = lambda number, result, there: None,
        retry: bool = False,
    ) -> bool:
        """Compute the missing points; False on an MPI rank that only helped.

        tell: called with the number of a point, its result, and whether it existed already; retry:
        failed runs continue from where they failed.  Raises KeyboardInterrupt if a signal stopped a
        run.
        """
        with open_engine(engine, jobs) as opened:
            if opened is not None:
                self.check()
                with self.claimed():
                    self._compute(opened, tell, retry)
        return opened is not None

    def _compute(
        self, engine: Engine, tell: Callable[[int, Result, bool], None], retry: bool
    ) -> None:

        def take(number: int, result: Result, there: bool = False) -> None:
            self.results[number] = result
            tell(number, result, there)

        works: dict[int, Work] = {}
        for number in range(len(self.results)):
            work = self.make_work(number, share_processors(engine.workers), retry)
            try:
                known = read_result(work.folder, compute_digest_of(work))
            except BadInput as error:
                take(number, Result(digest="", failure=str(error)))
                continue
            if known is not None and not (known.failure and retry):
                take(number, known, there=True)
            else:
                works[number] = work
        if len(works) > 1 and engine.workers > 1 and self.definition.function is None:
            # one step of one point of each kind, so that not every worker compiles the same
            # kernels: these are made for materials, limiters and the like, for what is no number
            first_works = [works[number] for number in self._find_kinds(works, int | float)]
            for _ in engine.compute(warm_up, first_works):
                pass  # faults of a point are reported when it is computed
        numbers = list(works)
        for place, found in engine.compute(compute_point, list(works.values())):
            if isinstance(found, Exception):
                found = Result(digest="", failure=_describe_error(found))
            if found.stopped:
                raise KeyboardInterrupt(found.reason)
            take(numbers[place], found)

    def make_work(self, number: int, threads: int | None = None, retry: bool = False) -> Work:
        """The work of a point for a worker, with absolute paths."""
        definition = self.definition
        point = self.definition.points[number]
        folder = (self.path / "runs" / point.name).resolve()
        values = {**definition.fixed, **point}
        if definition.function is not None:
            own = definition.function, values
            return Work(definition.source, write_settings(point), folder, None, retry, *own)
        return Work(definition.deck, write_settings(values), folder, threads, retry)

    def describe_states(self) -> list[str]:
        """State of each point: "done", "failed", "half", "other", "new", or a sentence."""
        states = []
        for number in range(len(self.results)):
            work = self.make_work(number)
            try:
                states.append(find_state(work.folder, compute_digest_of(work)))
            except BadInput as error:
                states.append(str(error))
        return states


def _say_state(result: Result | None) -> str:
    """How a run ended; a failure by its sentence."""
    if result is None:
        return "not run"
    return f"failed: {result.failure}" if result.failure else result.reason


def _describe_error(error: Exception) -> str:
    """A sentence for what a worker raised."""
    if isinstance(error, MemoryError):
        return "not enough memory; fewer cells or fewer jobs need less"
    died = type(error).__module__.startswith(("shockgrid.runs.", "distributed"))
    if died or isinstance(error, BadInput):
        return str(error)
    return f"a mistake in shockgrid itself ({type(error).__name__}: {error})"


def _find_start_names(problem_name: str, problem: Problem) -> list[str]:
    """Names of results, errors and measurements, from a history with only its first row."""
    evolution = problem.build()
    measured = problem.measure(evolution)
    row = {"step": evolution.step, "t": evolution.t, **get_start_row(evolution), **measured}
    history = {name: np.array([value]) for name, value in row.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # one row is too little for some formulas
        found = Result(digest="")
        fill_numbers(found, problem_name, problem, history, measured)
    return [*found.values, *measured]


def make_study(
    deck: str | Path | Callable[..., Mapping[str, float]],
    vary: Mapping[str, Any],
    output: str | Path,
    points: Sequence[Mapping[str, Any]],
    fixed: Mapping[str, Any],
    shown: Sequence[str],
    refine: str | None,
) -> Study:
    """The study of a deck, a study file, a study's folder or a function; arguments: `study`.

    fixed: keys for all points.  Raises BadInput for an invalid study.
    """
    file = None if callable(deck) else is_study(str(deck))
    if file is None:
        source = deck if callable(deck) else str(deck)
        definition = make_definition(source, vary, points, fixed, shown)
    elif vary or points or fixed:
        raise BadInput(f"{deck} is a study already: change {file}, or give it no keys and values")
    else:
        definition = read_definition(file)
        if FUNCTION.fullmatch(definition.source):
            raise BadInput(
                f"{deck} is a study of the function {definition.source}, known to Python alone: "
                "give shockgrid.study the function, what is varied and this folder"
            )
        definition = replace(definition, shown=tuple(shown) or definition.shown)
        output = output or (file.parent if Path(str(deck)).is_dir() else "")
    if not str(output):
        raise BadInput("study: the output folder is missing (-o DIR)")
    return Study(definition, output, refine)


def study(
    deck: str | Path | Callable[..., Mapping[str, float]],
    vary: Mapping[str, Any] | None = None,
    output: str | Path = "",
    *,
    points: Sequence[Mapping[str, Any]] = (),
    settings: Mapping[str, Any] | None = None,
    shown: Sequence[str] = (),
    jobs: int | None = 1,
    engine: str | Executor = "processes",
    refine: str | None = None,
    **keywords: Any,
) -> Study | None:
    """Compute a deck at many points, as `shockgrid study` does, and return the study.

    deck: problem, packaged deck, deck file, study file, the folder of a study, or a function that
    takes the varied keys as keywords and returns numbers by name; vary: values by key, or text as
    for `--vary` ("1.2:3:7"), whose product is computed; points: instead of it; settings, or
    keywords as for `run` (cells=32): keys for all points; output: the folder, created if necessary;
    shown: quantities of the picture; jobs, engine: as `open_engine` takes them, an executor of
    `concurrent.futures`, dask or mpi4py among them (with several jobs a script calls this under
    `if __name__ == "__main__":`, and a function is one of a module).

    None on MPI ranks that only compute.  Raises BadInput for an invalid study; runs that fail are
    in `Study.failures`.  Raises KeyboardInterrupt if it was stopped; it can be continued.
    """
    fixed = flatten({**(settings or {}), **keywords})
    made = make_study(deck, vary or {}, output, points, fixed, shown, refine)
    try:
        if not made.run(engine, jobs):
            return None
    except KeyboardInterrupt:
        left = count(made.results.count(None), "run")
        raise KeyboardInterrupt(
            f"stopped with {left} to do; study({str(output)!r}) continues"
        ) from None
    made.write()
    return made
