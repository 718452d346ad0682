"""Descent on the controls."""
