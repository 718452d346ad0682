"""Quadratic programs: backends, the active set, and the least violating point."""
