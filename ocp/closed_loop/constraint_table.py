"""The largest violation of every constraint along a loop, each in its own unit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from ocp.plotting.single_variable import single_variables
from ocp.problem.constraint_rows import ConstraintRow, Violation
from ocp.problem.ocp import OCP

_FILE = "violations_"


class TableRow(NamedTuple):
    """One constraint.

    Attributes:
        name: what a message calls it; several rows of one constraint are numbered.
        amount: its largest violation; 0: it was kept.
        t: when that was [s]; 0 where it was kept.
        unit: of the amount; empty where it is not known.
    """

    name: str
    amount: float
    t: float
    unit: str

    def __str__(self) -> str:
        """Return it in words."""
        if not self.amount:
            return f"{self.name}: kept"
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.name}: {self.amount:.3g}{unit} at t = {self.t:.4g} s"


@dataclass(frozen=True)
class ConstraintTable:
    """The rows of a loop; ``print`` shows them as a table.

    Attributes:
        rows: one for each bound and each row of a path constraint; empty where nothing limits
            the plant, or in a file of an older version.
    """

    rows: tuple[TableRow, ...] = ()

    def with_(self, plant: OCP, found: Sequence[Violation]) -> "ConstraintTable":
        """Return the table after one more interval, of which these are the violations."""
        if not self.rows:
            rows = [v.row for v in found if v.row is not None]
            if not rows:
                return self
            units = _units(plant)
            each = zip(numbered(rows), rows, strict=True)
            empty = (TableRow(name, 0.0, 0.0, units.get(row, "")) for name, row in each)
            return ConstraintTable(tuple(empty)).with_(plant, found)
        return ConstraintTable(
            tuple(
                row._replace(amount=v.amount, t=v.t) if v.amount > row.amount else row
                for row, v in zip(self.rows, found, strict=True)
            )
        )

    def __getitem__(self, name: str) -> TableRow:
        """Return the row of a name; KeyError with the names that there are."""
        known = {row.name: row for row in self.rows}
        if name not in known:
            raise KeyError(f"'{name}' is no constraint of the loop; they are {', '.join(known)}")
        return known[name]

    def __len__(self) -> int:
        """Return how many rows there are."""
        return len(self.rows)

    def __str__(self) -> str:
        """Return it as a table of text."""
        if not self.rows:
            return "no constraint"
        width = max(len(row.name) for row in self.rows)
        lines = [f"{'constraint':<{width}}  largest violation  when [s]"]
        for row in self.rows:
            said = f"{row.amount:.3g} {row.unit}".strip() if row.amount else "-"
            when = f"{row.t:.4g}" if row.amount else ""
            lines.append(f"{row.name:<{width}}  {said:>17}  {when:>8}".rstrip())
        return "\n".join(lines)

    def entries(self) -> dict[str, np.ndarray]:
        """Return it as arrays, for a file."""
        each = list(zip(*self.rows, strict=True)) or [(), (), (), ()]
        names, amounts, times, units = each
        return {
            f"{_FILE}names": np.array(names, dtype=str),
            f"{_FILE}units": np.array(units, dtype=str),
            f"{_FILE}amounts": np.array(amounts, dtype=float),
            f"{_FILE}times": np.array(times, dtype=float),
        }

    @classmethod
    def of_entries(cls, data: Mapping[str, np.ndarray]) -> "ConstraintTable":
        """Return the table of a file; an empty one where an older file has none."""
        if f"{_FILE}names" not in data:
            return cls()
        columns = (data[_FILE + part] for part in ("names", "amounts", "times", "units"))
        rows = zip(*columns, strict=True)
        return cls(tuple(TableRow(str(n), float(a), float(t), str(u)) for n, a, t, u in rows))


def numbered(rows: Sequence[ConstraintRow]) -> list[str]:
    """Return the names of rows, with a number where several are of one constraint."""
    names = [row.name for row in rows]
    return [
        f"{name} {names[:i].count(name)}" if names.count(name) > 1 else name
        for i, name in enumerate(names)
    ]


def _units(plant: OCP) -> dict[ConstraintRow, str]:
    """Return the units of bounds, and of constraints that are a variable but for a constant."""
    m = plant.model
    blank = ("",)
    of_states, of_inputs = m.x_units or blank * m.nx, m.u_units or blank * m.nu
    of_all = (*of_states, *of_inputs, *(m.z_units or blank * m.nz))
    found = dict(zip(plant.rows.states.rows, of_states, strict=True))
    found |= dict(zip(plant.rows.controls.rows, of_inputs, strict=True))
    paths = ca.vertcat(ca.SX(0, 1), *[c.expression for c in plant.at("path")])
    singles = zip(plant.rows.path.rows, single_variables(plant, paths), strict=True)
    return found | {row: of_all[v.place] for row, v in singles if v and abs(v.slope) == 1.0}
