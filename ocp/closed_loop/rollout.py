"""The record of a closed loop."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ocp.checks.arguments import check_instance, check_whole
from ocp.checks.errors import ProblemError, SolverError
from ocp.checks.progress import Progress
from ocp.checks.rich_text import html_of
from ocp.closed_loop.constraint_table import ConstraintTable
from ocp.closed_loop.decision import Decision, InputSource
from ocp.files.archive import made_of, read_archive, write_archive
from ocp.loop_plotting.loop_record import Draw
from ocp.plotting.compare import compared
from ocp.plotting.view import View
from ocp.problem.fingerprint import differing_in, fingerprint_entries
from ocp.problem.ocp import OCP

if TYPE_CHECKING:
    from ocp.plotting.picture import Picture

# A loop that takes more of its steps from the rungs without a good plan lives on them.
_TOLERATED = 0.05
# Older files have the place of a source in this list instead of its name.
_OLDER_SOURCES = ("OPTIMAL", "FEASIBLE", "SHIFTED", "BACKUP")


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Rollout:
    """A closed loop of K steps, as the plant saw it.

    Attributes:
        plant: the problem that the plant is: its cost and constraints judge.
        t: sampling instants [s], (K + 1,).
        x: true states (K + 1, nx).
        measured: what the controller was told (K, nx).
        inputs: what acted in each interval (K, m); under a delay it was decided earlier.
        sources: which rung each decision came from (K,).
        messages: why, where it was not the first (K,).
        costs: the plant's running cost over each interval (K,).
        violation: the plant's largest violation of a bound or constraint.
        worst: which, and the end of the sampling interval it happened in; empty where nothing is
            violated.
        violations: the largest violation of every bound and constraint, when, and in which unit;
            print it as a table.
        drift: largest violation of the plant's invariants at the sampling instants, such as
            the task error of an arm.
        step_times: time of each decision [s], (K,).
        clipped: by how much each input was clipped (K,).
        ended: why the loop ended early; empty if it did not.
        decisions: all of them, with their plans; empty where the rollout was loaded.
        late: intervals from a decision to its effect. The inputs of the first so many were
            decided before the rollout begins, or are the initial one.
    """

    plant: OCP
    t: np.ndarray
    x: np.ndarray
    measured: np.ndarray
    inputs: np.ndarray
    sources: tuple[InputSource, ...]
    messages: tuple[str, ...]
    costs: np.ndarray
    violation: float
    worst: str
    drift: float
    step_times: np.ndarray
    clipped: np.ndarray
    ended: str = ""
    violations: ConstraintTable = field(default_factory=ConstraintTable)
    decisions: tuple[Decision, ...] = ()
    late: int = 0

    def __repr__(self) -> str:
        """Return one line: what was controlled, what it cost, and where the inputs came from."""
        return (
            f"<Rollout of '{self.plant.name}': {self.t[-1]:g} s, cost {self.cost:.6g}, "
            f"{self.worst or 'nothing violated'}, {self.decided_by}>"
            f"{chr(10) + self.advice if self.advice else ''}"
        )

    def _repr_html_(self) -> str:
        """Return the loop in numbers, and the table of its constraints, for a notebook."""
        facts = [
            ("closed-loop cost", f"{self.cost:.6g}"),
            ("largest violation", self.worst or "none"),
            ("inputs", self.decided_by),
            ("slowest decision [s]", f"{self.step_times.max(initial=0.0):.3g}"),
        ]
        facts += [("advice", self.advice)] if self.advice else []
        return html_of(f"Loop with {self.plant.name}", str(self.violations), facts)

    @property
    def advice(self) -> str:
        """What to change where the loop lived on lower rungs; empty where it did not."""
        counts, few = self.counts, _TOLERATED * len(self.sources)
        violating, backup = counts[InputSource.LEAST_VIOLATING], counts[InputSource.BACKUP]
        said = []
        if violating > few:
            said.append(
                f"{violating} of {len(self.sources)} steps had no plan that meets the constraints: "
                "keep a distance from hard limits of states (a priced cushion before them), make "
                "them soft, or take a longer horizon; the messages say which constraint it was"
            )
        if backup > few:
            said.append(
                f"{backup} of {len(self.sources)} steps had no plan at all: the messages say what "
                "the solver brought instead"
            )
        return "; ".join(said)

    @property
    def decided_by(self) -> str:
        """How many decisions came from which rung, and why the loop ended early, in words."""
        said = ", ".join(f"{n} {o.name.lower()}" for o, n in self.counts.items() if n)
        return f"{said or 'no decision'}{f'; ended: {self.ended}' if self.ended else ''}"

    def acting(self, k: int) -> InputSource | None:
        """The rung whose input acts in interval k; None where it was decided before t0."""
        return self.sources[k - self.late] if k >= self.late else None

    @property
    def cost(self) -> float:
        """The closed-loop cost: the plant's running cost along its own trajectory."""
        return float(self.costs.sum())

    @property
    def counts(self) -> dict[InputSource, int]:
        """How many decisions came from each rung."""
        found = Counter(self.sources)
        return {source: found[source] for source in InputSource}

    def or_raise(self) -> "Rollout":
        """Return self, or raise ``SolverError`` if the loop ended early."""
        if self.ended:
            raise SolverError(f"the loop ended at t = {self.t[-1]:g} s: {self.ended}", self)
        return self

    def plot(
        self,
        variables: Sequence[str] = (),
        *,
        compare: "Rollout | Mapping[str, Rollout] | None" = None,
        time_unit: str = "s",
        constraints: str = "active",
        plans: int = 0,
        plane: Sequence[str] | None = None,
        against: str = "time",
    ) -> "Picture":
        """Return a picture: a panel for each state and input, and the running cost.

        True states are lines, what the controller was told are circles, references of its cost
        are dotted, limits of the plant are hatched; where the input does not come from an optimal
        plan the background is coloured.

        Args:
            variables: names of what is drawn, in this order; ``"running cost"`` is one. Empty:
                everything.
            compare: another rollout, or several by name: ``{"no backup": other}``.
            time_unit: ``"ms"``, ``"s"``, ``"min"``, ``"h"`` or ``"d"``.
            constraints: which path constraints have a panel: the ``"active"`` ones, ``"all"`` or
                ``"none"``.
            plans: every how many steps the plan ahead is drawn; 0: no plan. A rollout that was
                loaded has none.
            plane: two names ``(x, y)``: one picture of y over x instead.
            against: name of what is on the horizontal axis.

        Returns:
            a matplotlib ``Figure``; ``picture["speed"]`` are the axes that show the speed.

        Raises:
            ProblemError: if the loop has no step, a name is of nothing, or a unit is none.
        """
        from ocp.loop_plotting.rollout import plot_rollout  # matplotlib takes a second

        view = View(variables, against, time_unit, constraints)
        check_whole(plans, "plot: plans", least=0)
        return plot_rollout(compared(self, compare, Rollout, "a Rollout"), view, plane, plans)

    def animate(
        self,
        path: str | Path,
        *,
        draw: Draw | None = None,
        frames_per_second: int = 20,
        speed: float = 1.0,
        progress: Progress | None = None,
    ) -> Path:
        """Write the loop as an animated GIF; return its path.

        States and inputs grow with time; ahead of now the plan that is followed is dashed, its
        inputs only where what is sent are its controls. The title says the rung. A rollout
        that was loaded has no plans.

        Args:
            path: with the suffix ``.gif``; its folder is made.
            draw: (axes, x, t) draws the scene, on empty axes for every frame; x is interpolated
                between the samples.
            frames_per_second: 1 to 50.
            speed: seconds of the loop in a second of the film.
            progress: told after each frame how many are written, and of how many.

        Raises:
            ProblemError: if there is nothing to show, there would be thousands of frames, or an
                argument is out of its range.
        """
        from ocp.loop_plotting.animation import animate_rollout  # matplotlib takes a second

        return animate_rollout(
            self,
            path,
            draw=draw,
            frames_per_second=frames_per_second,
            speed=speed,
            progress=progress,
        )

    def save(self, path: str | Path) -> Path:
        """Write everything but the plant and the plans to one ``.npz`` file; return its path.

        A file of that name is replaced when the new one is whole and on the disk.

        Raises:
            ProblemError: if it cannot be written; a file that was there is as it was.
        """
        content: dict[str, Any] = {name: getattr(self, name) for name in (*_ARRAYS, *_SCALARS)}
        content |= {
            "outcomes": np.array([source.name for source in self.sources], dtype=str),
            "messages": np.array(self.messages, dtype=str),
            "plant": self.plant.name,
        }
        content |= self.violations.entries()
        content |= fingerprint_entries(self.plant)
        return write_archive(path, "rollout", content)

    @classmethod
    def load(cls, path: str | Path, plant: OCP) -> "Rollout":
        """Read a rollout of ``plant`` from a file that ``save`` wrote.

        Raises:
            ProblemError: if the file cannot be read, or belongs to another plant, by its name or
                by what its functions and bounds are.
            DamagedFile: if it is no rollout, or not as it was saved (older files have no
                checksum); ``whole_arrays`` reads what is left of it.
        """
        check_instance(plant, OCP, f"the plant that {path} is to be a loop with")
        needed = {"outcomes", "messages", "plant", *_ARRAYS, *_SCALARS}
        data = read_archive(path, "rollout", needed)
        if str(data["plant"]) != plant.name:
            raise ProblemError(f"{path} is a loop with '{data['plant']}', not '{plant.name}'")
        with made_of(path, "rollout"):
            other = differing_in(data, plant)
        if other:
            raise ProblemError(f"{path} is a loop with another '{plant.name}': {', '.join(other)}")
        with made_of(path, "rollout"):
            return cls._of(data, plant)

    @classmethod
    def _of(cls, data: Mapping[str, np.ndarray], plant: OCP) -> "Rollout":
        """Return the rollout of an archive."""
        names = _names_of(data["outcomes"])
        if unknown := set(names) - set(InputSource.__members__):
            raise ProblemError(f"a source is '{min(unknown)}', which is no rung")
        return cls(
            plant=plant,
            **{name: np.asarray(data[name], dtype=float) for name in _ARRAYS},
            **{name: kind(data[name][()]) for name, kind in _SCALARS.items()},
            violations=ConstraintTable.of_entries(data),
            sources=tuple(InputSource[name] for name in names),
            messages=tuple(map(str, data["messages"])),
        )


_ARRAYS = ("t", "x", "measured", "inputs", "costs", "step_times", "clipped")
_SCALARS = {"violation": float, "worst": str, "drift": float, "ended": str, "late": int}


def _names_of(sources: np.ndarray) -> list[str]:
    """Return the names of the sources in a file; a place that is none stays a number."""
    if sources.dtype.kind not in "iu":
        return [str(name) for name in sources]
    older = dict(enumerate(_OLDER_SOURCES))
    return [older.get(int(place), str(place)) for place in sources]
