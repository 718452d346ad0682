"""Figures of solutions; they take what they draw by structure."""
