"""Talking to a peer: its own process, one JSON object a line, a time limit for every answer."""

import json
import os
import signal
import subprocess
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue
from tempfile import TemporaryDirectory
from threading import Thread
from types import TracebackType
from typing import Any

_LAST_LINES = 3
# Longer lines say more than a table can hold.
_LONGEST = 300
# One thread each: a core more would be no merit of the method.
_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"}


class PeerFailed(Exception):
    """A peer did not start, ended, hung or spoke nonsense; the text quotes its last words."""


class Conversation:
    """A running peer.

    Its folder is a temporary one, since some peers write code there. What it prints is kept only
    to quote its last lines.
    """

    def __init__(self, command: Sequence[str]) -> None:
        """Start the process.

        Raises:
            PeerFailed: if there is no such program.
        """
        self._folder = TemporaryDirectory(ignore_cleanup_errors=True)
        self._last_words: deque[str] = deque(maxlen=_LAST_LINES)
        own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        try:
            self._process = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                cwd=self._folder.name,
                env=own | _ENVIRONMENT,
                start_new_session=True,
            )
        except OSError as error:
            self._folder.cleanup()
            raise PeerFailed(f"did not start: {error.strerror}") from error
        self._is_open = True
        self._answers: Queue[str] = Queue()
        self._readers = [
            Thread(target=self._listen, daemon=True),
            Thread(target=self._remember, daemon=True),
        ]
        for reader in self._readers:
            reader.start()
        self._writer = self._readers[0]

    def ask(self, request: dict[str, Any], limit: float) -> dict[str, Any]:
        """Send a request and return the answer.

        Args:
            request: anything that JSON can say.
            limit: time for the answer [s]; beyond it the process is ended.

        Raises:
            PeerFailed: if there is no answer, or none that is a JSON object.
        """
        # In a thread: a peer that does not listen would let us wait here without a limit.
        self._writer = Thread(target=self._write, args=(json.dumps(request),), daemon=True)
        self._writer.start()
        try:
            line = self._answers.get(timeout=limit)
        except Empty:
            self.close()
            raise PeerFailed(
                f"hung: no answer to '{request['do']}' in {limit:g} s{self._quoted()}"
            ) from None
        if not line:
            code = self._process.wait()
            self.close()
            raise PeerFailed(f"ended with code {code}{self._quoted()}")
        return self._understood(line)

    def close(self) -> None:
        """End the process and all it started, and remove its folder."""
        if not self._is_open:
            return
        self._is_open = False
        with suppress(ProcessLookupError, PermissionError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
            else:
                self._process.kill()
        self._process.wait()
        for thread in (self._writer, *self._readers):
            thread.join(timeout=1.0)
        for name in ("stdin", "stdout", "stderr"):
            with suppress(BrokenPipeError):
                self._pipe(name).close()
        self._folder.cleanup()

    def __enter__(self) -> "Conversation":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _pipe(self, name: str) -> Any:
        return getattr(self._process, name)

    def _write(self, line: str) -> None:
        pipe = self._pipe("stdin")
        with suppress(BrokenPipeError):  # it has ended, and its empty answer says so
            pipe.write(line + "\n")
            pipe.flush()

    def _listen(self) -> None:
        for line in self._pipe("stdout"):
            self._answers.put(line)
        self._answers.put("")

    def _remember(self) -> None:
        for line in self._pipe("stderr"):
            if line.strip():
                self._last_words.append(line.strip()[:_LONGEST])

    def _quoted(self) -> str:
        self._readers[1].join(timeout=1.0)
        said = " | ".join(self._last_words)
        return f"; its last words: {_without_paths(said)}" if said else "; it said nothing"

    def _understood(self, line: str) -> dict[str, Any]:
        try:
            answer = json.loads(line)
        except json.JSONDecodeError:
            answer = None
        if not isinstance(answer, dict):
            self.close()
            raise PeerFailed(f"spoke no JSON: {line.strip()[:_LONGEST]!r}{self._quoted()}")
        return answer


def _without_paths(text: str) -> str:
    """Return a text with the names of files in place of their paths: it may become data."""
    words = (Path(w.strip("\"',")).name if w.count(os.sep) > 1 else w for w in text.split())
    return " ".join(words)
