"""Constraints for solvers that do not know them, and held between the nodes."""
