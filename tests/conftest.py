"""What holds for all tests: none fails by the clock; of what goes over a library a third runs."""

from collections import Counter

import pytest
from hypothesis import settings

# On a loaded machine a quick example may take a second.
settings.register_profile("no clock", deadline=None)
settings.load_profile("no clock")

# One in so many of the cases of a test that goes over the library; the others run at night.
_SHARE = 3


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let ``make nightly`` ask for all of them."""
    parser.addoption("--nightly", action="store_true", help="run every case of every test")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out two in three cases of the tests that are marked ``over_library``.

    Which ones is always the same. Of several poses of one case another third runs each, since
    their number is no multiple of three.
    """
    if config.getoption("--nightly"):
        return
    counts, kept, left = Counter[str](), [], []
    for item in items:
        name = item.nodeid.split("[")[0]
        chosen = item.get_closest_marker("over_library") is None or counts[name] % _SHARE == 0
        counts[name] += 1
        (kept if chosen else left).append(item)
    if left:
        config.hook.pytest_deselected(items=left)
        items[:] = kept
