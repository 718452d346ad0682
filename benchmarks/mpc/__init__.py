"""Closed loops compared: the arm over the horizon, faults, delay, other plants."""
