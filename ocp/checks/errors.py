"""The exceptions of the toolkit: one root, three kinds, and files."""


class OCPError(Exception):
    """Root of every error that the toolkit raises on purpose."""


class ProblemError(OCPError, ValueError):
    """A description or an input is wrong; the message names symbol, shape and stage."""


class DamagedFile(ProblemError):
    """A file is not what it should be, or not as it was written.

    The message names the file, the place, and what can still be read of it, and how.
    """


class UnsupportedProblem(OCPError, TypeError):
    """A solver cannot treat this (valid) problem; the message names the term that stops it."""


class SolverError(OCPError, RuntimeError):
    """A solution was required (``Solution.or_raise``), but the solver did not reach one.

    Args:
        message: why.
        result: what was reached instead, with its problem and status: the ``Solution``, or the
            ``Rollout`` that ended early; None where there is none.
    """

    def __init__(self, message: str, result: object = None) -> None:
        """Keep the result."""
        super().__init__(message)
        self.result = result
