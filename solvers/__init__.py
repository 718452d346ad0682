"""One method a file; a solver is a frozen dataclass whose fields are its options."""

from solvers.constrained.augmented_lagrangian import AugmentedLagrangian
from solvers.constrained.between_nodes import BetweenNodes
from solvers.constrained.raised import raise_until_clear
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.gradient.line_search import Armijo, FixedStep, StepRule
from solvers.gradient.schuetz import Schuetz
from solvers.indirect.continuation import HorizonContinuation, ParameterContinuation
from solvers.indirect.indirect_shooting import IndirectShooting
from solvers.indirect.second_order import SecondOrder, second_order
from solvers.linear.batch import Batch
from solvers.linear.linear_mpc import LinearMPC
from solvers.linear.riccati import Riccati
from solvers.multistart import LocalOptimum, multistart
from solvers.polish import polish
from solvers.predictive.gpc import GPC, GPCLaw
from solvers.predictive.gpc_loop import GPCRun, gpc_loop
from solvers.tabular.bellman import Table
from solvers.tabular.greedy import Greedy
from solvers.tabular.grid import Axis
from solvers.tabular.grid_dp import GridDP

__all__ = [
    "GPC",
    "Armijo",
    "AugmentedLagrangian",
    "Axis",
    "Batch",
    "BetweenNodes",
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
    "raise_until_clear",
    "second_order",
]
