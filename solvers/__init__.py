"""One method a file; a solver is a frozen dataclass whose fields are its options."""

from solvers.batch import Batch
from solvers.bellman import Table
from solvers.continuation import HorizonContinuation, ParameterContinuation
from solvers.gpc import GPC, GPCLaw
from solvers.gpc_loop import GPCRun, gpc_loop
from solvers.greedy import Greedy
from solvers.grid import Axis
from solvers.grid_dp import GridDP
from solvers.indirect_shooting import IndirectShooting
from solvers.line_search import Armijo, FixedStep, StepRule
from solvers.linear_mpc import LinearMPC
from solvers.multiple_shooting import MultipleShooting
from solvers.multistart import LocalOptimum, multistart
from solvers.polish import polish
from solvers.riccati import Riccati
from solvers.schuetz import Schuetz
from solvers.second_order import SecondOrder, second_order

__all__ = [
    "GPC",
    "Armijo",
    "Axis",
    "Batch",
    "FixedStep",
    "GPCLaw",
    "GPCRun",
    "Greedy",
    "GridDP",
    "HorizonContinuation",
    "IndirectShooting",
    "LinearMPC",
    "LocalOptimum",
    "MultipleShooting",
    "ParameterContinuation",
    "Riccati",
    "Schuetz",
    "SecondOrder",
    "StepRule",
    "Table",
    "gpc_loop",
    "multistart",
    "polish",
    "second_order",
]
