"""What benchmarks and tests build on, and users of solvers need not know."""

from solvers.certify.certificate import Check, Estimate, Verdict
from solvers.diagnose.cause import Cause
from solvers.diagnose.finding import Finding, Severity
from solvers.direct.multiple_shooting import MultipleShootingProgram
from solvers.indirect.reverse.invariant_manifold import InvariantManifold
from solvers.indirect.reverse.scan import Scan
from solvers.indirect.reverse.self_motion import SelfMotion, seeds_around, self_motions
from solvers.kinematic.hierarchy import Level, prioritised_velocity
from solvers.kinematic.pseudo_inverse import Inverse
from solvers.tabular.bellman import ValueFunction

__all__ = [
    "Cause",
    "Check",
    "Estimate",
    "Finding",
    "InvariantManifold",
    "Inverse",
    "Level",
    "MultipleShootingProgram",
    "Scan",
    "SelfMotion",
    "Severity",
    "ValueFunction",
    "Verdict",
    "prioritised_velocity",
    "seeds_around",
    "self_motions",
]
