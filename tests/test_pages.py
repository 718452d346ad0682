"""The code of the tutorial and the gallery runs as it stands there, and prints what they say."""

from pathlib import Path

import pytest

from benchmarks.pages.page import DOCS, Page, difference, pages

PAGES = pages()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_it_prints_what_it_says(
    page: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for step, printed in page.run():
        if step.said:
            assert not (said := difference(step.said, printed)), said
    for picture in page.pictures:
        assert (tmp_path / picture).stat().st_size > 5_000
        assert (DOCS / "_static" / "pages" / picture).exists()


def test_there_are_pages() -> None:
    assert sum(page.name.startswith("learn/") for page in PAGES) == 5


@pytest.mark.parametrize(
    ("said", "printed", "same"),
    [
        ("cost 1.2345 s", "cost 1.2346 s", True),
        ("cost 1.2345 s", "cost 1.2445 s", False),
        ("cost 1.2345 s", "price 1.2345 s", False),
        ("violated by ...", "violated by 163 at t = 30 s", True),
        ("violated by ...", "not violated", False),
        ("one", "one\ntwo", False),
        ("1e-9 of it", "3e-10 of it", True),
        ("[1 2]", "[1 2 3]", False),
    ],
)
def test_numbers_may_differ_by_a_thousandth_and_words_may_not(said, printed, same) -> None:
    assert (difference(said, printed) == "") is same
