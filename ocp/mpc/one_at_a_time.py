"""One thread at a time, and none inside itself."""

from threading import Lock, get_ident
from types import TracebackType

from ocp.checks.errors import ProblemError


class OneAtATime:
    """Lets one thread in at a time: others wait; the one inside is refused.

    ``contextlib`` has the same in fewer lines, at several times the cost of a lock: a control step
    pays it.

    Args:
        refusal: said to a thread that comes in while it is inside.
    """

    def __init__(self, refusal: str) -> None:
        """Begin with nobody inside."""
        self._refusal = refusal
        self._lock = Lock()
        self._inside: int | None = None

    def __enter__(self) -> None:
        """Wait until nobody is inside.

        Raises:
            ProblemError: if this thread is inside already.
        """
        if self._inside == get_ident():
            raise ProblemError(self._refusal)
        self._lock.acquire()
        self._inside = get_ident()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Let the next one in."""
        self._inside = None
        self._lock.release()
