"""One method a file; a solver is a frozen dataclass whose fields are its options."""

from solvers.direct.multiple_shooting import MultipleShooting
from solvers.gradient.line_search import Armijo, FixedStep, StepRule
from solvers.gradient.schuetz import Schuetz
from solvers.indirect.continuation import HorizonContinuation, ParameterContinuation
from solvers.indirect.enumerate_extremals import Enumeration, enumerate_extremals
from solvers.indirect.indirect_shooting import IndirectShooting
from solvers.indirect.manifold import Kept, Manifold
from solvers.indirect.reverse_shooting import ReverseShooting
from solvers.indirect.scan import Scan
from solvers.indirect.second_order import SecondOrder, second_order
from solvers.indirect.self_motion import SelfMotion, seeds_around, self_motions
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
    "Axis",
    "Batch",
    "Enumeration",
    "FixedStep",
    "GPCLaw",
    "GPCRun",
    "Greedy",
    "GridDP",
    "HorizonContinuation",
    "IndirectShooting",
    "Kept",
    "LinearMPC",
    "LocalOptimum",
    "Manifold",
    "MultipleShooting",
    "ParameterContinuation",
    "ReverseShooting",
    "Riccati",
    "Scan",
    "Schuetz",
    "SecondOrder",
    "SelfMotion",
    "StepRule",
    "Table",
    "enumerate_extremals",
    "gpc_loop",
    "multistart",
    "polish",
    "second_order",
    "seeds_around",
    "self_motions",
]
