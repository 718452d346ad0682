"""When a row counts as a success: by what the referee measures, not by what the solver says."""

from dataclasses import dataclass

from benchmarks.sweep.row import FEASIBLE, SAME_OPTIMUM, Row


@dataclass(frozen=True)
class ReportLevel:
    """Thresholds with a name.

    Attributes:
        name: how accurate that is, in a word.
        violation: largest violation of any constraint, in its own unit.
        gap: distance of the cost from the reference, relative, either way.
        stationarity: residual of the minimum principle where there is no reference, in the unit
            of the control.
    """

    name: str
    violation: float
    gap: float
    stationarity: float

    def met_by(self, row: Row) -> bool | None:
        """Return whether a row meets it; None: nothing is there to judge it by."""
        if row.cost is None or row.violation is None or row.violation > self.violation:
            return False
        if row.gap is not None:
            return abs(row.gap) <= self.gap
        if row.stationarity is not None:
            return row.stationarity <= self.stationarity
        return None


LEVELS = (
    ReportLevel("low", FEASIBLE, SAME_OPTIMUM, 1e-2),
    ReportLevel("medium", 1e-6, 1e-4, 1e-4),
    ReportLevel("high", 1e-6, 1e-6, 1e-5),
)
LOW = LEVELS[0]
