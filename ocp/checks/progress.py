"""How far a long computation is: what it tells, a bar of text, and Ctrl-C with what was found."""

import shutil
import sys
from typing import Any, Protocol, TextIO

from ocp.checks.arguments import check_callable, check_whole, class_in_words
from ocp.checks.errors import ProblemError

# Lets a terminal go one line up.
_UP = "\x1b[A"


class Progress(Protocol):
    """A function that is told how far a computation is.

    It may raise ``KeyboardInterrupt`` to stop it, as Ctrl-C does.
    """

    def __call__(self, done: int, total: int, said: str = "", /) -> object:
        """Take how many parts are done, of how many at most, and what was found last."""
        ...


class Interrupted(KeyboardInterrupt):
    """A computation was stopped by Ctrl-C; what was found until then is kept.

    Attributes:
        so_far: what was found, as the docstring of the function says.
    """

    def __init__(self, what: str, so_far: Any) -> None:
        """Keep it."""
        super().__init__(f"{what} was stopped; what was found is in so_far of this exception")
        self.so_far = so_far


class TextProgress:
    """A bar of text, ``progress=TextProgress()``; the last line stays.

    Args:
        stream: where it is written; default ``sys.stderr``. One that is no terminal gets a line
            for each report.
        width: of the bar, in letters.

    Raises:
        ProblemError: if the stream cannot be written to, or the width is no positive number.
    """

    def __init__(self, stream: TextIO | None = None, width: int = 20) -> None:
        """Begin a new line at the first report."""
        is_file = all(hasattr(stream, name) for name in ("write", "flush", "isatty"))
        if stream is not None and not is_file:
            raise ProblemError(
                f"TextProgress: stream is {class_in_words(stream)}, it cannot be written to; "
                "give an open text file, or leave it out for sys.stderr"
            )
        self._stream = stream
        self._width = check_whole(width, "TextProgress: width")
        # What was reported last of a computation that has not said its end.
        self._last: int | None = None

    def __call__(self, done: int, total: int, said: str = "", /) -> None:
        """Write how far it is."""
        stream = self._stream or sys.stderr
        filled = round(self._width * min(done / total, 1.0)) if total else self._width
        bar = f"[{'#' * filled}{'.' * (self._width - filled)}] {done} of {total}  {said}".rstrip()
        if stream.isatty():
            columns = shutil.get_terminal_size().columns - 1
            # Each report ends its line, since nobody knows which one is the last; the next goes up.
            goes_on = self._last is not None and self._last <= done
            stream.write(f"{_UP if goes_on else ''}\r{bar[:columns]:<{columns}}\n")
            self._last = done if done < total else None
        else:
            stream.write(f"{bar}\n")
        stream.flush()


def told(progress: Progress | None, what: str) -> Progress:
    """Return a function that can be told how far it is, checked; one that is silent for None."""
    if progress is None:
        return _silent
    check_callable(progress, f"{what}: progress")
    return progress


def _silent(done: int, total: int, said: str = "", /) -> None:
    """Say nothing."""
