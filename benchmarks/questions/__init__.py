"""Open questions of the thesis, decided by a computation of their own."""
