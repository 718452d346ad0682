"""Certificates of cases: made here, kept as data, read by the library as its references."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.cases import Case
from benchmarks.row import versions
from ocp import Solution, SolverError
from solvers import Certificate, Check, Effort, MultipleShooting, certify, multistart

CLOSED_FORM = "closed form"
# Digits in which a certificate has to agree with a derivation.
_CLOSED_FORM_ERROR = 1e-8
# Where a certificate starts: the finer grid where the coarser solves nothing; what held
# controls violate between nodes is left to its methods.
_INTERVALS, _BETWEEN = (75, 300), 1e-2


@dataclass(frozen=True)
class Certificates:
    """What is on file.

    Attributes:
        versions: of what computed.
        entries: by name of the case, as ``Certificate.as_dict`` has them.
    """

    versions: Mapping[str, str] = field(default_factory=dict)
    entries: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path) -> "Certificates":
        """Read a file; nothing where there is none.

        Raises:
            ValueError: if it is no file of certificates.
        """
        if not file.exists():
            return cls()
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            return cls(content["versions"], content["cases"])
        except (json.JSONDecodeError, KeyError, TypeError) as reason:
            raise ValueError(f"{file} is no file of certificates: {reason!r}") from None

    def with_(self, case: str, certificate: Certificate) -> "Certificates":
        """Return them with one more, or one anew."""
        entries = {**self.entries, case: certificate.as_dict()}
        return Certificates(versions(), dict(sorted(entries.items())))

    def write(self, file: Path) -> None:
        """Write them in one piece, so that a killed run leaves the old file or the new one."""
        content = {"versions": dict(self.versions), "cases": dict(self.entries)}
        file.parent.mkdir(parents=True, exist_ok=True)
        draft = file.with_suffix(".new")
        draft.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        draft.replace(file)


def certify_case(case: Case, effort: Effort) -> Certificate:
    """Certify the best optimum that a few direct starts find.

    The problem's own guess is the first of them.

    Raises:
        SolverError: if none of them is feasible.
        UnsupportedProblem: if no method says anything.
    """
    certificate = certify(_best_start(case, effort), effort)
    reference = case.reference
    if reference is None or not reference.is_closed_form:
        return certificate
    apart = abs(certificate.cost - reference.value) / max(1.0, abs(reference.value))
    said = f"{reference.value:.12g}, {apart:.1e} apart ({reference.how})"
    return certificate.with_check(Check.at_most(CLOSED_FORM, apart, _CLOSED_FORM_ERROR, said))


def _best_start(case: Case, effort: Effort) -> Solution:
    ocp = case.build()
    for intervals in _INTERVALS:
        solver = MultipleShooting(intervals)
        found = multistart(ocp, solver, effort.starts, effort.seed, violation=_BETWEEN)
        if found:
            return found[0].solution
    raise SolverError(f"{case.name}: none of {effort.starts} starts is feasible")
