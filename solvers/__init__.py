"""One method a file; a solver is a frozen dataclass whose fields are its options."""

from solvers.direct.multiple_shooting import MultipleShooting
from solvers.gradient.line_search import Armijo, FixedStep, StepRule
from solvers.gradient.schuetz import Schuetz
from solvers.indirect.continuation import HorizonContinuation, ParameterContinuation
from solvers.indirect.indirect_shooting import IndirectShooting
from solvers.indirect.second_order import SecondOrder, second_order
from solvers.kinematic.hierarchy import Level, prioritised_velocity
from solvers.kinematic.prioritised import PrioritisedKinematics
from solvers.kinematic.program import KinematicProgram
from solvers.kinematic.pseudo_inverse import Damped, Exact, Filtered, Inverse
from solvers.kinematic.repulsion import Repulsion, repel
from solvers.kinematic.run import KinematicRun
from solvers.kinematic.task import Task, descend, track
from solvers.linear.batch import Batch
from solvers.linear.linear_mpc import LinearMPC
from solvers.linear.riccati import Riccati
from solvers.multistart import LocalOptimum, multistart, random_guesses
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
    "Damped",
    "Exact",
    "Filtered",
    "FixedStep",
    "GPCLaw",
    "GPCRun",
    "Greedy",
    "GridDP",
    "HorizonContinuation",
    "IndirectShooting",
    "Inverse",
    "KinematicProgram",
    "KinematicRun",
    "Level",
    "LinearMPC",
    "LocalOptimum",
    "MultipleShooting",
    "ParameterContinuation",
    "PrioritisedKinematics",
    "Repulsion",
    "Riccati",
    "Schuetz",
    "SecondOrder",
    "StepRule",
    "Table",
    "Task",
    "descend",
    "gpc_loop",
    "multistart",
    "polish",
    "prioritised_velocity",
    "random_guesses",
    "repel",
    "second_order",
    "track",
]
