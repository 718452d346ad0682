"""Pontryagin's minimum principle, derived symbolically."""
