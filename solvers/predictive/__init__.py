"""Generalised predictive control of CARIMA models."""
