"""A peer: another package that solves the same problems, in an environment of its own."""

from dataclasses import dataclass
from pathlib import Path

_HERE = Path(__file__).parent


@dataclass(frozen=True)
class PeerPackage:
    """A package and the script that speaks for it.

    Args:
        name: what a user types; also the name of its environment.
        about: the package and the method in one line.
        script: file of ``scripts/``.
        requirements: file of ``requirements/`` with exact versions; empty: it runs in our own
            environment, since all that it needs is there.
        settings: ways to run it, a row in the table each.
        folder: where the script is.
    """

    name: str
    about: str
    script: str
    requirements: str = ""
    settings: tuple[str, ...] = ("",)
    folder: Path = _HERE / "scripts"

    @property
    def wanted(self) -> str:
        """What has to be installed, a line each."""
        if not self.requirements:
            return ""
        return (_HERE / "requirements" / self.requirements).read_text(encoding="utf-8")

    def title(self, setting: str) -> str:
        """Return what the table calls it."""
        return f"{self.name}, {setting}" if setting else self.name


PEERS: tuple[PeerPackage, ...] = (
    PeerPackage(
        "scipy", "solve_bvp of scipy on the equations of the minimum principle", "scipy_bvp.py"
    ),
    PeerPackage(
        "qpmpc",
        "linear MPC condensed to a quadratic program; its setting is the backend",
        "qpmpc_qp.py",
        "qpmpc.txt",
        ("osqp", "piqp", "proxqp", "daqp", "quadprog"),
    ),
    PeerPackage(
        "do-mpc",
        "direct, IPOPT; its collocation, or our RK4 step as a discrete model",
        "do_mpc_direct.py",
        "do-mpc.txt",
        ("same grid", "collocation"),
    ),
    PeerPackage(
        "acados",
        "SQP with HPIPM, generated C; full steps to convergence, or real-time iteration",
        "acados_sqp.py",
        "acados.txt",
        ("SQP", "SQP, Gauss-Newton", "RTI"),
    ),
    PeerPackage("rockit", "direct multiple shooting, IPOPT", "rockit_direct.py", "rockit.txt"),
    PeerPackage(
        "crocoddyl",
        "differential dynamic programming with boxes around the controls",
        "crocoddyl_ddp.py",
        "crocoddyl.txt",
    ),
    PeerPackage(
        "control",
        "python-control: single shooting, SLSQP of scipy; its setting is where slopes come from",
        "control_optimal.py",
        "control.txt",
        ("our derivatives", "differences"),
    ),
    PeerPackage(
        "ssqp",
        "SQP along the stages, HPIPM or ADMM within",
        "ssqp_qp.py",
        "ssqp.txt",
        ("HPIPM", "HPIPM, projected", "ADMM, projected"),
    ),
    PeerPackage(
        "nmpyc",
        "direct, IPOPT, on our RK4 step as a discrete system",
        "nmpyc_direct.py",
        "nmpyc.txt",
    ),
)
