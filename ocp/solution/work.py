"""What a method did, free of the machine it ran on."""

from dataclasses import dataclass, fields


@dataclass(frozen=True)
class Work:
    """What a method did, free of the machine it ran on.

    Attributes:
        rollouts: integrations of the whole trajectory (states, or states and costates).
        jacobians: evaluations of the first derivatives along the whole trajectory.
        factorisations: linear systems factorised.
    """

    rollouts: int = 0
    jacobians: int = 0
    factorisations: int = 0

    def __add__(self, other: "Work") -> "Work":
        """Return the work of both."""
        return Work(*[getattr(self, f.name) + getattr(other, f.name) for f in fields(self)])
