"""Methods: a solver is a frozen dataclass whose fields are its options."""

from solvers.certify.certificate import Certificate
from solvers.certify.certify import CertifyOptions, certify
from solvers.collocation.collocation import Collocation
from solvers.collocation.mesh import Mesh
from solvers.collocation.refine_mesh import MeshRefinement, refine_mesh
from solvers.constrained.augmented_lagrangian import AugmentedLagrangian
from solvers.constrained.between_nodes import BetweenNodes
from solvers.constrained.penalty_continuation import penalty_continuation
from solvers.diagnose.diagnose import diagnose
from solvers.diagnose.diagnosis import Diagnosis
from solvers.diagnose.finding import Finding
from solvers.direct.multiple_shooting import MultipleShooting
from solvers.direct.native.export.export_c import export_c
from solvers.direct.newton.stagewise_newton import StagewiseNewton
from solvers.gradient.line_search import Armijo, FixedStep
from solvers.gradient.schuetz import Schuetz
from solvers.indirect.continuation import HorizonContinuation, ParameterContinuation
from solvers.indirect.indirect_shooting import IndirectShooting
from solvers.indirect.reverse.enumerate_extremals import Enumeration, enumerate_extremals
from solvers.indirect.reverse.reverse_shooting import ReverseShooting
from solvers.indirect.second_order import SecondOrder, second_order
from solvers.kinematic.kinematic_run import KinematicRun
from solvers.kinematic.prioritised_kinematics import PrioritisedKinematics
from solvers.kinematic.pseudo_inverse import Damped, Exact, Filtered
from solvers.kinematic.repulsion import Repulsion, repel
from solvers.kinematic.task import Task, descend, track
from solvers.linear.batch import Batch
from solvers.linear.linear_mpc import LinearMPC
from solvers.linear.riccati import Riccati
from solvers.many.many_solutions import ManySolutions
from solvers.many.solve_many import solve_many
from solvers.multistart import LocalOptimum, multistart, random_guesses
from solvers.polish import polish
from solvers.predictive.gpc import GPC, GPCLaw
from solvers.predictive.gpc_loop import GPCRun, gpc_loop
from solvers.switching.switched import SwitchedSolution, switched
from solvers.tabular.greedy import Greedy
from solvers.tabular.grid_dp import GridDP
from solvers.tabular.state_grid import Axis
from solvers.via_points import via_point_guesses

__all__ = [
    "GPC",
    "Armijo",
    "AugmentedLagrangian",
    "Axis",
    "Batch",
    "BetweenNodes",
    "Certificate",
    "CertifyOptions",
    "Collocation",
    "Damped",
    "Diagnosis",
    "Enumeration",
    "Exact",
    "Filtered",
    "Finding",
    "FixedStep",
    "GPCLaw",
    "GPCRun",
    "Greedy",
    "GridDP",
    "HorizonContinuation",
    "IndirectShooting",
    "KinematicRun",
    "LinearMPC",
    "LocalOptimum",
    "ManySolutions",
    "Mesh",
    "MeshRefinement",
    "MultipleShooting",
    "ParameterContinuation",
    "PrioritisedKinematics",
    "Repulsion",
    "ReverseShooting",
    "Riccati",
    "Schuetz",
    "SecondOrder",
    "StagewiseNewton",
    "SwitchedSolution",
    "Task",
    "certify",
    "descend",
    "diagnose",
    "enumerate_extremals",
    "export_c",
    "gpc_loop",
    "multistart",
    "penalty_continuation",
    "polish",
    "random_guesses",
    "refine_mesh",
    "repel",
    "second_order",
    "solve_many",
    "switched",
    "track",
    "via_point_guesses",
]
