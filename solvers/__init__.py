"""One method a file; a solver is a frozen dataclass whose fields are its options."""

from solvers.collocation.collocation import Collocation
from solvers.collocation.mesh import Mesh
from solvers.collocation.refined import Refinement, Round, refined
from solvers.constrained.augmented_lagrangian import AugmentedLagrangian
from solvers.constrained.between_nodes import BetweenNodes
from solvers.constrained.raised import raise_until_clear
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.direct.stagewise_newton import StagewiseNewton
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
    "AugmentedLagrangian",
    "Axis",
    "Batch",
    "BetweenNodes",
    "Collocation",
    "Damped",
    "Enumeration",
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
    "Kept",
    "KinematicProgram",
    "KinematicRun",
    "Level",
    "LinearMPC",
    "LocalOptimum",
    "Manifold",
    "Mesh",
    "MultipleShooting",
    "ParameterContinuation",
    "PrioritisedKinematics",
    "Refinement",
    "Repulsion",
    "ReverseShooting",
    "Riccati",
    "Round",
    "Scan",
    "Schuetz",
    "SecondOrder",
    "SelfMotion",
    "StagewiseNewton",
    "StepRule",
    "Table",
    "Task",
    "descend",
    "enumerate_extremals",
    "gpc_loop",
    "multistart",
    "polish",
    "prioritised_velocity",
    "raise_until_clear",
    "random_guesses",
    "refined",
    "repel",
    "second_order",
    "seeds_around",
    "self_motions",
    "track",
]
