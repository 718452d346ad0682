"""Extremals by reverse integration from their final state."""
