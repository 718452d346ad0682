"""Figures and films of closed loops; they take what they draw by structure."""
