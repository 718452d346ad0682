"""The suites that compare solvers: ``python -m benchmarks``."""
