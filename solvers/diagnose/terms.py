"""A normal form in the words of the user: what its names stand for."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ocp import OCP, Constraint
from ocp.internal import NormalForm, Origin
from solvers.diagnose.finding import Finding


@dataclass(frozen=True, eq=False)
class Terms:
    """What a problem under examination is called by the user.

    Attributes:
        written: the problem as it was written, with its algebraic variables solved for.
        origins: what names stand for that only the normal form has.
    """

    written: OCP
    origins: Mapping[str, Origin] = field(default_factory=dict)

    @classmethod
    def of(cls, ocp: OCP, form: NormalForm | None) -> "Terms":
        """Return the terms of a problem, which may be a normal form."""
        return cls(ocp) if form is None else cls(form.original.explicit, form.origins)

    def label(self, c: Constraint, instant: float | None = None) -> str:
        """Return what a sentence calls a constraint, of the normal form or as it was written.

        Args:
            c: the constraint.
            instant: when [s], of a constraint at instants as it was written.
        """
        origin = self.origins.get(c.name, Origin(c.name, str(c.at), instant))
        when = self.instant(c) if instant is None else instant
        if when is not None:
            return f"the constraint '{origin.name}' at {when:g} s"
        if origin.place == "instants":
            return f"the constraint '{origin.name}' at instants"
        if origin.place == "rate":
            return f"the bound of the {origin.name}"
        if origin.place == "peak":
            return f"the peak '{origin.name}'"
        return f"the {origin.place} constraint '{origin.name}'"

    def instant(self, c: Constraint) -> float | None:
        """Return when a constraint holds that is one at an instant [s] for the user."""
        origin = self.origins.get(c.name)
        return None if origin is None else origin.instant

    def is_written(self, c: Constraint) -> bool:
        """Whether somebody wrote a constraint: the copy of the start is by definition."""
        origin = self.origins.get(c.name)
        return origin is None or origin.place != "definition"

    def said(self, finding: Finding) -> Finding:
        """Return a finding with the names that the user gave."""
        names = [self.origins[n].name if n in self.origins else n for n in finding.where]
        return replace(finding, where=tuple(dict.fromkeys(names)))
