"""A claim: a sentence with a number in it that a run can bear out or not."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Claim:
    """A sentence with a number in it, and whether the rows bear it out."""

    text: str
    holds: bool
    evidence: str
