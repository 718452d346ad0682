"""What README and docs name is there: files, links, commands with their options."""

import re
import shlex
from importlib import import_module
from pathlib import Path

import pytest

from benchmarks.__main__ import _parser

ROOT = Path(__file__).parent.parent
PACKAGES = ("ocp", "models", "solvers", "benchmarks")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
# What a command writes, and is not there before.
WRITTEN = ("results/",)
FILE = re.compile(r"`((?:[\w.-]+/)+[\w.-]*)`")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
COMMAND = re.compile(r"python -m benchmarks ([a-z][^`\n#]*)")


def is_room(name: str) -> bool:
    """A room of a package may be named without what is above it."""
    return any(any((ROOT / package).rglob(name.rstrip("/"))) for package in PACKAGES)


@pytest.mark.parametrize("page", PAGES, ids=[p.name for p in PAGES])
def test_files_and_links_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = [name for name in FILE.findall(text) if not name.startswith(WRITTEN)]
    lost = [name for name in named if not ((ROOT / name).exists() or is_room(name))]
    links = [link for link in LINK.findall(text) if "://" not in link]
    lost += [link for link in links if not (page.parent / link).exists()]
    assert lost == []


@pytest.mark.parametrize("page", PAGES, ids=[p.name for p in PAGES])
def test_commands_parse(page: Path) -> None:
    for words in COMMAND.findall(page.read_text(encoding="utf-8")):
        _parser().parse_args(shlex.split(words))  # ends the process where it does not know one


@pytest.mark.parametrize("package", ["ocp", "solvers", "models"])
def test_the_api_page_has_every_name_once(package: str) -> None:
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    named = []
    for block in page.split(".. currentmodule:: ")[1:]:
        module, _, rest = block.partition("\n")
        if module == package:
            named += re.findall(r"^\.\. auto\w+:: (\w+)$", rest.split("```")[0], re.MULTILINE)
    assert sorted(named) == sorted(import_module(package).__all__)
