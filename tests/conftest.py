"""What holds for all tests: none fails by the clock; of what is done many times a third runs."""

import gc
from collections import Counter
from collections.abc import Generator

import pytest
from hypothesis import settings

# On a loaded machine a quick example may take a second.
settings.register_profile("no clock", deadline=None)
settings.load_profile("no clock")

# One in so many of the cases of a test that goes over the library, or over many inputs.
_SHARE = 3


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let ``make nightly`` ask for all of them."""
    parser.addoption("--nightly", action="store_true", help="run every case of every test")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Look for tests without looking for garbage, a third of the time: nothing is dropped here."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(tryfirst=True)  # before pytest looks which tests are slow
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Take one in three cases of the tests that do the same many times.

    Of those marked ``over_library`` the others run in ``make nightly`` only; of those marked
    ``many`` they are slow: ``make quick`` leaves them out, ``make test`` does not. Which ones is
    always the same; what is chosen by name, with ``-k`` or ``::``, runs as a whole. Of several
    poses of one case another third runs each, since the number of cases is no multiple of three.
    """
    counts, kept, left = Counter[str](), [], []
    for item in items:
        name = item.nodeid.split("[")[0]
        k = counts[name]
        counts[name] += 1
        # First, last, middle of three: where a case comes in two or three ways, each is taken.
        if item.get_closest_marker("many") and (k + k // _SHARE) % _SHARE:
            item.add_marker(pytest.mark.slow)
        is_left = item.get_closest_marker("over_library") and k % _SHARE
        (left if is_left else kept).append(item)
    if left and not config.getoption("--nightly") and not _is_asked_for_by_name(config):
        config.hook.pytest_deselected(items=left)
        items[:] = kept


def _is_asked_for_by_name(config: pytest.Config) -> bool:
    """Whether ``-k`` or an argument such as ``test_x.py::test_y`` chooses tests."""
    return bool(config.option.keyword) or any("::" in given for given in config.args)
