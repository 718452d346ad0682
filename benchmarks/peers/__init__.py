"""Other packages beside ours, on the same problems: ``python -m benchmarks peers``.

Each peer runs in an environment and a process of its own, spoken to by JSON with a time limit;
it is told the problem as lists of elementary operations, and our referee judges its controls.
"""

from benchmarks.peers.compare import compare
from benchmarks.peers.entry import BadResults, Entry, PeerReport
from benchmarks.peers.environment import Environment, InstallFailed, NotInstalled
from benchmarks.peers.jobs import JOBS
from benchmarks.peers.peer import PEERS, PeerPackage
from benchmarks.peers.tables import markdown, quicker, tables

__all__ = [
    "JOBS",
    "PEERS",
    "BadResults",
    "Entry",
    "Environment",
    "InstallFailed",
    "NotInstalled",
    "PeerPackage",
    "PeerReport",
    "compare",
    "markdown",
    "quicker",
    "tables",
]
