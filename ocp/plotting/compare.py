"""What a picture of compared solutions calls each of them."""

from collections.abc import Mapping
from typing import TypeVar

from ocp.checks.errors import ProblemError

T = TypeVar("T")


def compared(own: T, compare: object, kind: type[T], what: str) -> dict[str, T]:
    """Return solutions by what a legend calls them, one's own first.

    Args:
        own: whose method ``plot`` was called.
        compare: None, another one, or a mapping from names to others.
        kind: what they must be.
        what: that in words.

    Raises:
        ProblemError: if ``compare`` is anything else.
    """
    if compare is None:
        return {"": own}
    others = dict(compare) if isinstance(compare, Mapping) else {"the other": compare}
    if not others:
        raise ProblemError("plot: compare is empty")
    found: dict[str, T] = {"this one": own}
    for name, other in others.items():
        if not isinstance(other, kind):
            raise ProblemError(
                f"plot: compare has {type(other).__name__} in it: give {what}, or several by name "
                'in a dict, compare={"warm": other}'
            )
        if str(name) in found:
            raise ProblemError(f"plot: compare: the name '{name}' is that of this one")
        found[str(name)] = other
    return found
