"""Inverse kinematics from instant to instant, in the order of priority."""
