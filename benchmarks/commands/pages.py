"""``pages``: run the code of the documentation's pages, and renew the pictures that they show."""

from argparse import ArgumentParser, Namespace
from contextlib import chdir
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.progress import track

from benchmarks.commands.command import Command
from benchmarks.commands.options import named
from benchmarks.pages.page import DOCS, Page, Shown, pages
from benchmarks.pages.small_png import write_small

_SHOWN = DOCS / "_static" / "pages"


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("names", nargs="*", metavar="NAME", help="learn, pictures, ...")


def _run(options: Namespace, console: Console) -> int:
    chosen = named(pages(), options.names, "page", by_beginning=True)
    wrong = 0
    for page in track(chosen, "pages", console=console):
        for said in _renewed(page):
            console.print(f"{page.name}: {said}", markup=False)
            wrong += 1
    console.print(f"{len(chosen)} pages, {wrong} differences; pictures are in {_SHOWN}")
    return int(wrong > 0)


def _renewed(page: Page) -> list[str]:
    """Run a page, keep the pictures that it shows, and return what differs from what it says."""
    found = []
    with TemporaryDirectory() as folder, chdir(folder):
        for part in page.run():
            if isinstance(part, Shown):
                write_small(part.figure, _SHOWN / part.file)
            elif part.difference:
                found.append(part.difference)
    return found


PAGES = Command("pages", "run the code of the pages, renew their pictures", _options, _run)
