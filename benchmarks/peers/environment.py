"""Where a peer is installed: a virtual environment of its own in the user's cache folder.

Their dependencies clash with ours and with each other, so that none can live in our environment.
"""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks.peers.peer import PeerPackage
from ocp import Compiler
from ocp.internal import write_file

_BIN = "Scripts" if sys.platform == "win32" else "bin"
_STAMP = "installed.txt"


class NotInstalled(Exception):
    """A peer has no environment, or one of other versions; the text says what to type."""


class InstallFailed(Exception):
    """An environment could not be made; the text has the last line of what went wrong."""


@dataclass(frozen=True)
class Environment:
    """The environment of a peer.

    Args:
        peer: whose it is.
        cache: folder of all environments; None: ``ocp-toolkit/peers`` in the user's cache.
    """

    peer: PeerPackage
    cache: Path | None = None

    @property
    def folder(self) -> Path:
        """Where it is."""
        return (self.cache or Compiler().folder / "peers") / self.peer.name

    @property
    def is_installed(self) -> bool:
        """Whether everything that is wanted is there, in the versions that are wanted."""
        if not self.peer.requirements:
            return True
        stamp = self.folder / _STAMP
        return stamp.exists() and stamp.read_text(encoding="utf-8") == self.peer.wanted

    @property
    def python(self) -> Path:
        """Its interpreter; ours where the peer needs nothing else."""
        return self.folder / _BIN / "python" if self.peer.requirements else Path(sys.executable)

    def command(self) -> list[str]:
        """Return how its script is started: without our packages, nor the user's.

        Raises:
            NotInstalled: if it is not.
        """
        if not self.is_installed:
            raise NotInstalled(
                f"{self.peer.name} is not installed: python -m benchmarks peers install "
                f"{self.peer.name}"
            )
        return [str(self.python), "-E", "-s", str(self.peer.folder / self.peer.script)]

    def install(self) -> None:
        """Make the environment anew unless it is there.

        Raises:
            InstallFailed: if that fails; what was made is removed.
        """
        if self.is_installed:
            return
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.parent.mkdir(parents=True, exist_ok=True)
        wanted = self.folder.with_suffix(".txt")
        wanted.write_text(self.peer.wanted, encoding="utf-8")
        try:
            self._call([sys.executable, "-m", "venv", str(self.folder)])
            pip = [str(self.python), "-m", "pip", "--disable-pip-version-check", "install"]
            self._call([*pip, "--quiet", "-r", str(wanted)])
        finally:
            wanted.unlink()
        write_file(self.folder / _STAMP, self.peer.wanted.encode())

    def _call(self, words: list[str]) -> None:
        own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        done = subprocess.run(words, capture_output=True, text=True, check=False, env=own)
        if done.returncode != 0:
            shutil.rmtree(self.folder, ignore_errors=True)
            said = (done.stderr or done.stdout).strip().splitlines() or ["without a word"]
            raise InstallFailed(f"{self.peer.name} could not be installed: {said[-1][:300]}")
