"""The code stays plain: one statement a line, names that say their whole meaning."""

import ast
import io
import re
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = ("regrid", "hydro", "problems", "runs", "shockgrid")
MOST_PARALLEL_PART = 0.01  # of all assignments of a package
# parts of names that tell the components of one thing from each other
COMPONENTS = (
    ("x", "y"),
    ("x", "y", "z"),
    ("i", "j"),
    ("i", "j", "k"),
    ("u", "v"),
    ("u", "v", "w"),
    ("r", "z"),
    ("left", "right"),
    ("low", "high"),
    ("lower", "upper"),
)
UNITS = {"MM", "GPA", "US"}  # numbers of one word that everybody knows


def read_trees(package: str) -> Iterator[tuple[Path, ast.Module]]:
    for path in sorted((ROOT / package).rglob("*.py")):
        yield path, ast.parse(path.read_text(encoding="utf-8"))


def find_name(target: ast.expr) -> str:
    if isinstance(target, ast.Subscript):
        return find_name(target.value)
    return getattr(target, "attr", getattr(target, "id", ""))


def strip_component(name: str, component: str) -> str | None:
    """The name without the component at one of its ends or between two of its words."""
    for pattern in (rf"(^|_){component}(_|$)", rf"{component}$", rf"^{component}"):
        if re.search(pattern, name):
            return re.sub(pattern, "", name, count=1)
    return None


def are_components(names: list[str]) -> bool:
    """Whether the names are those of one thing's components: x, y; area_i, area_j."""
    for components in COMPONENTS:
        if len(components) == len(names):
            stems = {strip_component(*both) for both in zip(names, components, strict=True)}
            if len(stems) == 1 and None not in stems:
                return True
    return False


def is_exchange(targets: list[ast.expr], values: list[ast.expr]) -> bool:
    """Whether a value needs what an earlier target was, so that lines of their own would differ."""
    written = {ast.unparse(target) for target in targets}
    read = {ast.unparse(node) for value in values for node in ast.walk(value)}
    return bool(written & read)


def is_packed(node: ast.AST) -> bool:
    """Whether an assignment joins things that are not one: a parallel one of different things."""
    if not isinstance(node, ast.Assign):
        return False
    target = node.targets[0]
    if not isinstance(target, ast.Tuple) or not isinstance(node.value, ast.Tuple):
        return False
    names = [find_name(one) for one in target.elts]
    return not are_components(names) and not is_exchange(target.elts, node.value.elts)


@pytest.mark.parametrize("package", [*PRODUCT, "tests", "benchmarks"])
def test_assignments_are_not_packed(package):
    assignments = 0
    packed = []
    for path, tree in read_trees(package):
        for node in ast.walk(tree):
            assignments += isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign)
            if is_packed(node):
                packed.append(f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node)}")
    assert len(packed) <= MOST_PARALLEL_PART * assignments, "\n".join(packed)


def find_numbers(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Numeric constants of a module and their values: numbers, and sums of such."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name = node.targets[0].id
            parts = list(ast.walk(node.value))
            numbers = [one for one in parts if isinstance(one, ast.Constant)]
            numeric = all(isinstance(one.value, int | float) for one in numbers)
            plain = not any(
                isinstance(one, ast.Call | ast.Tuple | ast.List | ast.Subscript) for one in parts
            )
            if name.isupper() and numbers and numeric and plain:
                yield name, ast.unparse(node.value)


@pytest.mark.parametrize("package", PRODUCT)
def test_constants_say_their_whole_meaning(package):
    values = defaultdict(set)
    words = Counter()
    for _, tree in read_trees(package):
        for name, value in find_numbers(tree):
            values[name].add(value)
            words[name] += "_" not in name.strip("_")
    assert not {name for name, count in words.items() if count} - UNITS
    assert not {name: found for name, found in values.items() if len(found) > 1}


# constants of one or two letters: the field's symbols for quantities and coefficients, which also
# stand in the formulas of docstrings
SYMBOLS = set("U V P C C2 E X Y NX NY A B R1 R2 C0 S".split())


@pytest.mark.parametrize("package", ["regrid", "hydro"])
def test_constants_of_two_letters_are_symbols(package):
    short = set()
    for path, tree in read_trees(package):
        for node in tree.body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            names = [
                name.id
                for target in targets
                for name in ast.walk(target)
                if isinstance(name, ast.Name)
            ]
            short |= {(path.name, name) for name in names if name.isupper() and len(name) <= 2}
    assert {name for _, name in short} <= SYMBOLS, sorted(short)


# names and options that a user writes out, one by one
TAKES_MANY = {
    "regrid.barrier.regridder.BarrierRegridder.__init__",
    "regrid.variational.VariationalRegridder.__init__",
    "hydro.block.Block.__init__",
    "hydro.boundary.FreeSurface.__init__",
    "hydro.simulation.Simulation.__init__",
    "runs.interface.calls.restart",
    "runs.interface.case.Drawn.plot",
    "runs.study.study.study",
}
MOST_ARGUMENTS = 8


def find_functions(node: ast.AST, name: str) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Functions in a module, class or function, with their full names."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.ClassDef):
            own = f"{name}.{child.name}"
            if isinstance(child, ast.FunctionDef):
                yield own, child
            yield from find_functions(child, own)
        else:
            yield from find_functions(child, name)


def count_arguments(function: ast.FunctionDef) -> int:
    given = function.args
    names = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")]) + sum(
        one is not None for one in (given.vararg, given.kwarg)
    )


@pytest.mark.parametrize("package", PRODUCT)
def test_few_functions_take_many_arguments(package):
    many = set()
    for path, tree in read_trees(package):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for name, function in find_functions(tree, module):
            if count_arguments(function) > MOST_ARGUMENTS:
                many.add(name)
    assert many == {name for name in TAKES_MANY if name.startswith(f"{package}.")}


# files that know the weight of the barrier regridder's term of cells: its formulas, its number, and
# its option with the bounds; another term costs as many (docs/extending.md)
KNOW_COST_WEIGHT = {"functional.py", "tuning.py", "regridder.py"}


def test_a_term_of_the_barrier_regridder_stays_in_its_files():
    found = set()
    for path, tree in read_trees("regrid/barrier"):
        names = {getattr(node, "attr", getattr(node, "arg", "")) for node in ast.walk(tree)}
        if "cost_weight" in names:
            found.add(path.name)
    assert found <= KNOW_COST_WEIGHT


# capital words of docstrings and comments that are no names of the code
ACRONYMS = set(
    "ASCII CPU CRC ED1 ED2 ED3 EDC EDS EOS GCL GIF GNU HLLC HTML IEEE JSON JWL LLVM MPI MUSCL NACA"
    " NFS NUMBA PEP SDIRK URI XDMF XML".split()
)
# programs and formats of others, with names of their own
OF_OTHERS = {"H5LT_FILE_IMAGE_OPEN_RW", "MPICH", "NUMBA_CPU_FEATURES", "NUMBA_CPU_NAME"}
OF_OTHERS |= {"NUMBA_ENABLE_AVX", "X_Y"}
CAPITALS = re.compile(r"\b[A-Z][A-Z_]{2,}[A-Z0-9_]*\b|\b[A-Z][A-Z0-9]*_[A-Z0-9_]*\b")


def find_docstrings(tree: ast.Module) -> Iterator[ast.Constant]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and node.body:
            first = node.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                yield first.value


def read_words(path: Path) -> tuple[set[str], set[tuple[int, str]]]:
    """Capital names in the code of a file, and the same in its docstrings and comments by lines."""
    text = path.read_text(encoding="utf-8")
    docstrings = {node.lineno: str(node.value) for node in find_docstrings(ast.parse(text))}
    code = set()
    told = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        line = token.start[0]
        if token.type == tokenize.COMMENT:
            words = [] if "noqa" in token.string else CAPITALS.findall(token.string)
            told.update((line, word) for word in words)
        elif token.type == tokenize.STRING and line in docstrings:
            told.update((line, word) for word in CAPITALS.findall(docstrings[line]))
        elif token.type in (tokenize.NAME, tokenize.STRING):
            code.update(CAPITALS.findall(token.string))
    return code, told


def test_constants_that_docstrings_name_exist():
    """A renamed constant is renamed in what is said about it, too."""
    code = ACRONYMS | OF_OTHERS
    told = set()
    for package in PRODUCT:
        for path in sorted((ROOT / package).rglob("*.py")):
            of_file, told_there = read_words(path)
            code |= of_file
            told |= {(path.relative_to(ROOT), line, word) for line, word in told_there}
    missing = sorted(f"{path}:{line}: {word}" for path, line, word in told if word not in code)
    assert not missing, "\n".join(missing)
