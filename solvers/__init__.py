"""One method a file; a solver is a frozen dataclass whose fields are its options."""

from solvers.multiple_shooting import MultipleShooting

__all__ = ["MultipleShooting"]
