"""The report: one file, nothing from outside, whatever is or is not in the folder."""

import csv
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from urllib.parse import unquote

import pytest

from benchmarks.__main__ import main
from benchmarks.methods.method import Settings
from benchmarks.report import report_page
from benchmarks.report.growth import exponent
from benchmarks.report.level import LEVELS, LOW
from benchmarks.report.limitations import limitations
from benchmarks.report.page import SECTIONS
from benchmarks.report.plot import power_of_ten
from benchmarks.report.profiles import ratios_to_best
from benchmarks.report.rows import parts_of
from benchmarks.report.section import Points
from benchmarks.report.sheet import SHOWN, Sheet
from benchmarks.report.success import share
from benchmarks.sweep.row import RESULTS, TIMED_OUT, Row
from benchmarks.sweep.task import SweepTask
from tests.benchmarks.chromium import CHROMIUM, opened
from tests.benchmarks.test_claims import row as arm_row

WHEN = "2026-11-22T08:22:57+00:00"
# What a page must not take for its own.
EVIL = "<script>alert('x')</script> & $x^2$"


def row(**changes) -> Row:
    return replace(arm_row(machine={"cores": "2"}, versions={"casadi": "3"}, when=WHEN), **changes)


def suite() -> list[Row]:
    """Rows that every plot can be made of."""
    rows = []
    for i, case in enumerate(("arm-001-sum", "arm-002-sum", "arm-003-sum")):
        for j, method in enumerate(("direct-75", "direct-150", "shooting")):
            gap, time = 10.0 ** -(3 + 2 * j), 0.1 * (i + j + 1)
            options = f"MultipleShooting(intervals={75 * (j + 1)})"
            rows.append(row(case=case, solver=method, gap=gap, violation=10.0 ** -(8 + i),
                            solve_time=time, intervals=75 * (j + 1), settings=options,
                            states=3 + i))  # fmt: skip
    task = SweepTask("arm", "arm-004-sum", "direct-75", "", Settings())
    rows.append(replace(Row.lost(task, TIMED_OUT, EVIL, 9.0), when=WHEN))
    return rows


class Page(HTMLParser):
    """What a page consists of."""

    def __init__(self, text: str):
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def text() -> str:
    return report_page(suite(), [f"line 3 is no row: {EVIL}"], "A report")


@pytest.fixture(scope="module")
def page(text) -> Page:
    return Page(text)


def test_nothing_is_asked_of_a_network(text, page):
    addresses = [a[name] or "" for _, a in page.tags for name in ("src", "href") if name in a]
    assert addresses
    assert {address.partition(":")[0] for address in addresses if address[0] != "#"} == {"data"}
    assert not re.search(r"""(?:src|href)\s*=\s*["']?\s*(?:https?:)?//""", text)
    assert not re.search(r"url\((?!#)|@import", text)
    assert not page.all("img")
    assert all("src" not in script for script in page.all("script"))


def test_every_section_and_its_plots_are_there_with_their_data(page):
    names = [attributes["id"] for attributes in page.all("section")]
    assert names == ["notes", *(section(suite()).name for section in SECTIONS)]
    figures = [attributes["id"] for attributes in page.all("figure")]
    assert len(figures) == 9
    assert len(page.all("svg")) == len(figures)
    files = {a["download"]: a["href"] or "" for a in page.all("a") if "download" in a}
    for figure in figures:
        lines = list(csv.reader(io.StringIO(unquote(files[f"{figure}.csv"].partition(",")[2]))))
        assert len(lines) > 1, figure


def test_ids_are_unique_and_what_they_are_used_for_exists(text, page):
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    used = re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', text)
    assert {one or other for one, other in used} <= set(ids)


def test_text_of_rows_stays_text(text):
    assert EVIL not in text
    assert "&lt;script&gt;alert" in text
    evil = report_page([row(solver=EVIL, case=EVIL, message=EVIL)], [], EVIL)
    assert "<script>alert" not in evil


# Names that would leave an attribute, an id, a script, a style, a regular expression or a drawing.
NAMES = [
    's"><script>alert(1)</script>',
    "s' onload='alert(1)",
    "</script><script>alert(1)</script>",
    "</style><img src=x onerror=alert(1)>",
    "]]></svg><script>alert(1)</script>",
    "--><script>alert(1)</script><!--",
    "javascript:alert(1)",
    "{{ 7 * 7 }}{% raw %}",
    "\\g<1>\\1(",
    'x" id="success" href="#run',
    "url(#x) #0a5e01 #010203 xlink:href",
    "=HYPERLINK(1)",
    "",
    "   ",
    "../../etc/passwd",
    "a\tb\nc\rd",
    "ünïcödé",
]
WHITELISTED = re.compile(r"[A-Za-z0-9_-]+")


@pytest.fixture(scope="module")
def scripts() -> int:
    """How many scripts a page has."""
    return len(Page(report_page([row()], [], "A report")).all("script"))


@pytest.mark.many
@pytest.mark.parametrize("name", NAMES)
def test_no_name_is_more_than_text(name, scripts):
    named = {"suite": name, "case": name, "message": name, "worst": name, "status": name}
    rows = [row(**named, solver=solver, settings=f"{name}(intervals={n})", intervals=n, gap=0.1 / n,
                violation=1e-3, machine={name: name}, versions={name: name}, when=name or WHEN)
            for n, solver in enumerate((name, f"{name} 2"), start=1)]  # fmt: skip
    text = report_page(rows, [name], "A report")
    page = Page(text)
    for tag, attributes in page.tags:
        assert tag not in ("img", "iframe", "object", "embed", "base", "form")
        assert not [a for a in attributes if a.startswith("on")], attributes
        assert WHITELISTED.fullmatch(attributes.get("id") or "x"), attributes
        assert WHITELISTED.fullmatch((attributes.get("download") or "x").removesuffix(".csv"))
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    addresses = [a["href"] or "" for _, a in page.tags if "href" in a]
    assert {address.partition(":")[0] for address in addresses if address[0] != "#"} == {"data"}
    assert {address[1:] for address in addresses if address[0] == "#"} <= set(ids)
    assert len(page.all("script")) == scripts


@pytest.mark.slow
def test_suites_that_differ_in_signs_only_have_addresses_of_their_own():
    rows = [row(suite=name) for name in ("a b", "a-b", "a?b", "a-b-2", "???", "!", "x-figure_1")]
    names = [part.name for part in parts_of(rows)]
    assert names == ["a-b", "a-b-2", "a-b-3", "a-b-2-2", "suite", "suite-2", "x-figure-1"]
    ids = [a["id"] for _, a in Page(report_page(rows, [], "A report")).tags if "id" in a]
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize(
    ("cell", "written"),
    [
        ("=1+1", "'=1+1"), ("+1+1", "'+1+1"), ("-1+1", "'-1+1"), ("@SUM(A1)", "'@SUM(A1)"),
        ("\t=1", "'\t=1"), ("\r=1", "'\r=1"), ("\n=1", "'\n=1"), (" =1", "' =1"),
        ("\uff1d1", "'\uff1d1"), ("-", "'-"), ("-inf", "'-inf"), ("-5+cmd|'!A0", "'-5+cmd|'!A0"),
        ("a=1", "a=1"), ("", ""), ("-5", "-5"), ("+1.5e-3", "+1.5e-3"),
        (-5, "-5"), (-1.5e-7, "-1.5e-07"), (None, ""), (True, "True"),
    ],
)  # fmt: skip
def test_no_cell_is_a_formula_and_numbers_stay_numbers(cell, written):
    lines = list(csv.reader(io.StringIO(Sheet("s", ("c", "d"), [(cell, 1.0)]).csv, newline="")))
    assert lines == [["c", "d"], [written, "1.0"]]
    assert next(csv.reader([Sheet("s", ("=c",), []).csv])) == ["'=c"]


def test_the_page_has_its_own_colours(text):
    drawings = "".join(re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL))
    assert "var(--s0)" in drawings
    assert "currentColor" in drawings
    assert not re.search(r"#0[123][0-9a-f]{4}\b", drawings)


@pytest.mark.many
@pytest.mark.parametrize(
    "rows",
    [
        [row()],
        [row(cost=None, gap=None, violation=None, stationarity=None, status="DIVERGED")],
        [row(reference=None, gap=None, stationarity=None)],
        [replace(suite()[-1], message="")],
        [row(status="UNHEARD_OF", gap=-3e-6)],
        [row(gap=0.0, solve_time=0.0, iterations=0, build_time=0.0)],
        [row(suite="a suite nobody knows", case="no-case")],
        [row(), row(seed=1, gap=1e300, machine={"cores": "4"}, versions={"casadi": "4"})],
    ],
)
def test_almost_nothing_makes_a_page_that_says_what_is_missing(rows):
    text = report_page(rows, [], "A report")
    assert text.count("<section") == len(SECTIONS)
    assert 'class="wide missing"' in text
    assert ">nan<" not in text


def test_levels_ask_the_referee_and_not_the_solver():
    assert [level.met_by(row()) for level in LEVELS] == [True, True, False]
    assert LOW.met_by(row(status="FAILED", solved=False))
    assert LOW.met_by(row(gap=6e-3)) is False
    assert LOW.met_by(row(gap=-6e-3)) is False
    assert LOW.met_by(row(violation=2e-3)) is False
    assert LOW.met_by(row(cost=None)) is False
    assert LOW.met_by(row(gap=None, stationarity=1e-3)) is True
    assert LOW.met_by(row(gap=None, stationarity=1e-1)) is False
    assert LOW.met_by(row(gap=None, stationarity=None)) is None
    assert share(LOW, [row(), row(gap=1.0), row(gap=None, stationarity=None)]) == 50.0
    assert share(LOW, [row(gap=None, stationarity=None)]) is None


def test_profiles_divide_by_the_best_of_those_that_succeed():
    rows = [
        row(case="a", solver="quick", solve_time=1.0),
        row(case="a", solver="slow", solve_time=3.0),
        row(case="b", solver="quick", solve_time=0.1, gap=1.0),
        row(case="b", solver="slow", solve_time=2.0),
    ]
    ratios = ratios_to_best(rows, lambda one: one.solve_time)
    assert ratios == {"quick": [1.0], "slow": [3.0, 1.0]}


def test_growth_measures_a_power():
    assert exponent([(3, 9.0), (4, 16.0), (5, 25.0)]) == pytest.approx(2.0)


def test_limitations_name_those_of_these_rows():
    two = [row(), row(machine={"cores": "4"}, reference=None, suite="links")]
    (points,) = limitations(two).blocks
    assert isinstance(points, Points)
    for word in ("2 machines", "One seed", "1 of the cases"):
        assert any(word in point for point in points.points), word


def test_a_long_table_is_cut_on_the_page_only():
    sheet = Sheet("long", ("n",), [(i,) for i in range(SHOWN + 5)])
    assert (len(sheet.shown), sheet.left_out) == (SHOWN, 5)
    assert len(sheet.csv.splitlines()) == SHOWN + 6


@pytest.mark.parametrize(
    ("value", "said"), [(1.0, "1"), (1e-3, "10⁻³"), (1e12, "10¹²"), (10.0, "10"), (0.02, "0.02")]
)
def test_powers_of_ten(value, said):
    assert power_of_ten(value) == said


@pytest.mark.slow
def test_the_command_writes_the_page_and_says_what_it_left_out(tmp_path, capsys):
    for one in suite():
        one.append_to(tmp_path / RESULTS)
    with (tmp_path / RESULTS).open("a") as end:
        end.write("torn")
    assert main(["report", str(tmp_path)]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    said = capsys.readouterr().out
    for place in (page, said):
        assert f"line 11 of {RESULTS} is no row" in place
    assert main(["report", str(tmp_path), "--out", str(tmp_path / "no" / "folder.html")]) == 2
    assert "cannot be written" in capsys.readouterr().out


@pytest.mark.parametrize("content", [None, "", "torn", '{"versions": {}}\n'])
def test_a_folder_without_rows_is_said_and_is_no_success(tmp_path, capsys, content):
    if content is not None:
        (tmp_path / RESULTS).write_text(content)
    assert main(["report", str(tmp_path)]) == 2
    assert "there is no row to report" in capsys.readouterr().out
    assert not (tmp_path / "report.html").exists()


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_a_browser_shows_it_without_a_complaint(tmp_path, text):
    file = tmp_path / "report.html"
    # A click on the first title of a table, as a person would, after the page's own script.
    click = "<script>document.querySelector('#success th').click()</script></body>"
    file.write_text(text.replace("</body>", click), encoding="utf-8")
    document, complaints = opened(file, tmp_path / "profile")
    assert complaints == []
    shown = Page(document)
    assert len(shown.all("svg")) == len(shown.all("figure")) == 9
    assert sum(th.get("data-order") == "up" for th in shown.all("th")) == 1
