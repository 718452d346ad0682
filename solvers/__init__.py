"""One method a file; a solver is a frozen dataclass whose fields are its options."""

from solvers.indirect_shooting import (
    HorizonContinuation,
    IndirectShooting,
    ParameterContinuation,
)
from solvers.line_search import Armijo, FixedStep, StepRule
from solvers.multiple_shooting import MultipleShooting
from solvers.multistart import LocalOptimum, multistart
from solvers.polish import polish
from solvers.schuetz import Schuetz
from solvers.second_order import SecondOrder, second_order

__all__ = [
    "Armijo",
    "FixedStep",
    "HorizonContinuation",
    "IndirectShooting",
    "LocalOptimum",
    "MultipleShooting",
    "ParameterContinuation",
    "Schuetz",
    "SecondOrder",
    "StepRule",
    "multistart",
    "polish",
    "second_order",
]
