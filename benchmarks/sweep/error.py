"""What ends a sweep, and not only a row of it."""


class SweepError(Exception):
    """No process starts, no scheduler answers, or another sweep has the folder."""
