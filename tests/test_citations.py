"""Every [Author Year] that the code or the documentation cites is in the list of references."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
CITATION = re.compile(r"\[((?:[A-Z][a-z]+)(?:(?:, | & | et al\.)[A-Za-z]*)* \d{4})")


def test_every_citation_is_listed():
    listed = set(CITATION.findall((ROOT / "docs" / "references.md").read_text(encoding="utf-8")))
    files = [
        f for p in ("ocp", "models", "solvers", "benchmarks") for f in (ROOT / p).rglob("*.py")
    ]
    files += [*(ROOT / "docs").glob("*.md"), ROOT / "README.md"]
    cited = {c: f.name for f in files for c in CITATION.findall(f.read_text(encoding="utf-8"))}
    assert len(cited) > 5
    assert {c: f for c, f in cited.items() if c not in listed} == {}
