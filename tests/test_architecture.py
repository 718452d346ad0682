"""The laws of the house that a machine can check (docs/architecture.md)."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import ocp

ROOT = Path(ocp.__file__).parent.parent
PACKAGES = ("ocp", "models", "solvers", "benchmarks")
LIBRARIES = ("ocp", "models", "solvers")
MAY_IMPORT = {
    "ocp": set(),
    "models": {"ocp"},
    "solvers": {"ocp"},
    "benchmarks": {"ocp", "models", "solvers"},
}
# Besides its root, what another package may import from: robots, bodies in space, textbook
# problems, and what siblings share but users need not know.
ENTRANCES = {
    *LIBRARIES,
    "models.robot",
    "models.shapes",
    "models.textbook",
    "ocp.internal",
    "solvers.internal",
}


def sources(*packages: str) -> list[Path]:
    return sorted(path for package in packages for path in (ROOT / package).rglob("*.py"))


def named(path: Path) -> str:
    return str(path.relative_to(ROOT))


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=named(path))


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Line and dotted name of everything a file imports, inside functions too."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{named(path)}:{node.lineno}: a relative import"
            yield node.lineno, node.module or ""


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def modules_of(path: Path) -> Iterator[str]:
    """Everything a file imports, down to the file that is meant."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.ImportFrom) and node.module:
            inside = [f"{node.module}.{alias.name}" for alias in node.names]
            is_module = [
                ROOT.joinpath(*name.split(".")).with_suffix(".py").exists() for name in inside
            ]
            yield from (name for name, found in zip(inside, is_module, strict=True) if found)
            if not all(is_module):
                yield node.module


def nowhere(wrong: Iterator[str]) -> None:
    """Nothing is wrong in any file; one test a law, since there are hundreds of files."""
    found = list(wrong)
    assert not found, "; ".join(found)


def wrong_imports(path: Path) -> Iterator[str]:
    own = path.relative_to(ROOT).parts[0]
    for line, module in imports(path):
        package = module.partition(".")[0]
        if package not in PACKAGES or package == own:
            continue
        where = f"{named(path)}:{line}: {module}"
        if package not in MAY_IMPORT[own]:
            yield f"{where}: {own} does not know {package}"
        if module not in ENTRANCES:
            yield f"{where}: across packages import from {sorted(ENTRANCES)}"


def test_imports_follow_the_layers_and_use_the_entrances() -> None:
    nowhere(wrong for path in sources(*PACKAGES) for wrong in wrong_imports(path))


def test_no_file_imports_itself_by_way_of_others() -> None:
    """No circle among the files of a package, imports inside functions included."""
    known = {module_name(path): path for path in sources(*PACKAGES)}
    imported = {name: set(modules_of(path)) & set(known) for name, path in known.items()}
    done: set[str] = set()

    def visit(name: str, way: tuple[str, ...]) -> None:
        assert name not in way, f"a circle: {' -> '.join((*way, name))}"
        if name not in done:
            for other in imported[name]:
                visit(other, (*way, name))
            done.add(name)

    for name in known:
        visit(name, ())


def printing(path: Path) -> Iterator[str]:
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print":
            yield f"{named(path)}:{node.lineno}: print"


def test_libraries_print_nothing() -> None:
    nowhere(wrong for path in sources(*LIBRARIES) for wrong in printing(path))


def broad_excepts(path: Path) -> Iterator[str]:
    broad = {"Exception", "BaseException"}
    for node in ast.walk(tree(path)):
        if not isinstance(node, ast.ExceptHandler):
            continue
        where = f"{named(path)}:{node.lineno}"
        if node.type is None:
            yield f"{where}: bare except"
        else:
            caught = {n.id for n in ast.walk(node.type) if isinstance(n, ast.Name)}
            if caught & broad:
                yield f"{where}: except {caught & broad}"


def test_exceptions_are_named() -> None:
    """A bare or broad except hides the bug beside the failure it is meant for."""
    nowhere(wrong for path in sources(*PACKAGES) for wrong in broad_excepts(path))


@pytest.mark.parametrize("entrance", sorted(ENTRANCES))
def test_an_entrance_lists_what_it_offers(entrance: str) -> None:
    """``__all__`` is the list: sorted, complete, and nothing else is public."""
    path = ROOT.joinpath(*entrance.split("."))
    module = tree(path / "__init__.py" if path.is_dir() else path.with_suffix(".py"))
    offered = [
        alias.asname or alias.name
        for node in module.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    ]
    listed = next(
        ast.literal_eval(node.value)
        for node in module.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__"
    )
    assert sorted(offered) == sorted(listed)


def test_a_file_says_what_it_is() -> None:
    paths = sources(*PACKAGES)
    nowhere(f"{named(p)} has no docstring" for p in paths if not ast.get_docstring(tree(p)))
