"""``batch-speed``: both ways give the same answers, and the table has a line a problem."""

import numpy as np

from benchmarks.speed.batch import batch_table, batches


def test_both_solve_the_same_starts() -> None:
    found = next(batches(8))
    assert found.in_c == 1.0
    assert found.apart < 1e-9
    assert len(found.one) == len(found.many) == len(found.threaded) == 1
    table = batch_table([found])
    assert next(iter(table.columns[0].cells)) == "arm, N = 35, cold"
    assert np.isfinite(float(str(next(iter(table.columns[4].cells)))))
