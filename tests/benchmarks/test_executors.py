"""The same sweep on a Dask cluster, and what is said where there is none."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from benchmarks.__main__ import main
from benchmarks.sweep.error import SweepError
from benchmarks.sweep.executors import Execution
from benchmarks.sweep.guard import Group
from benchmarks.sweep.row import RESULTS
from benchmarks.sweep.rows_file import read_rows
from benchmarks.sweep.sweep import sweep
from tests.benchmarks.test_sweep import DIRECT, QUICK, SMALL

distributed = pytest.importorskip("distributed")
# Nobody listens there: port 9 is that of a service which is no longer used.
NOBODY = "tcp://127.0.0.1:9"
DASHBOARD = "127.0.0.1:0"  # any free port
HANGING = Group(
    tuple(replace(SMALL[0], method=name) for name in ("good", "hangs")),
    60.0,
    "tests.benchmarks.faulty_child",
)


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Address of two workers in processes that may have no children of multiprocessing."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=DASHBOARD
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.slow
def test_a_cluster_gives_the_same_rows_and_resumes(tmp_path, cluster):
    here = sweep(SMALL, tmp_path / "here", resume=False, progress=False)
    far = Execution(scheduler=cluster)
    sweep(SMALL[:1], tmp_path / "far", resume=False, execution=far, progress=False)
    there = sweep(SMALL, tmp_path / "far", resume=True, execution=far, progress=False)
    assert [(row.key, row.cost, row.status) for row in there] == [
        (row.key, row.cost, row.status) for row in here
    ]
    assert len((tmp_path / "far" / RESULTS).read_text().splitlines()) == len(SMALL)


@pytest.mark.slow
def test_the_command_line_reaches_a_cluster(tmp_path, cluster):
    words = ["run", "--case", QUICK.name, "--solver", DIRECT[0]]
    words += ["--executor", "dask", "--scheduler", cluster, "--out", str(tmp_path)]
    assert main(words) == 0
    assert len(read_rows(tmp_path / RESULTS)) == 1


@pytest.mark.slow
def test_a_scheduler_that_goes_away_ends_the_sweep_not_the_rows(tmp_path):
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=DASHBOARD
    ) as cluster:
        execution = Execution(scheduler=cluster.scheduler_address)
        rows = execution.rows([HANGING])
        # As an event: the group that it belongs to has not ended, and never will.
        assert next(rows).solved
        cluster.close()
        with pytest.raises(SweepError, match="has gone"):
            next(rows)


@pytest.mark.slow
def test_a_cluster_without_workers_is_named(tmp_path):
    with distributed.LocalCluster(n_workers=0, dashboard_address=DASHBOARD) as cluster:
        execution = Execution(scheduler=cluster.scheduler_address, patience=1.0)
        with pytest.raises(SweepError, match="has no workers"):
            sweep(SMALL[:1], tmp_path, resume=False, execution=execution, progress=False)


@pytest.mark.parametrize("address", [NOBODY, "nonsense", "tcp://no-such-host.invalid:8786"])
def test_an_unreachable_scheduler_is_named_and_nothing_lost(tmp_path, address):
    execution = Execution(scheduler=address, patience=0.5)
    with pytest.raises(SweepError, match=f"no Dask scheduler answers at {address}"):
        sweep(SMALL[:1], tmp_path, resume=False, execution=execution, progress=False)


@pytest.mark.slow
def test_the_command_line_says_so_too(tmp_path, capsys):
    words = ["run", "--case", QUICK.name, "--solver", DIRECT[0], "--executor", "dask"]
    assert main([*words, "--scheduler", NOBODY, "--out", str(tmp_path)]) == 2
    assert f"no Dask scheduler answers at {NOBODY}" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["--executor", "dask"], ["--scheduler", NOBODY]])
def test_a_cluster_and_its_address_belong_together(words, capsys):
    assert main(["run", *words]) == 2
    assert "belong together" in capsys.readouterr().out
