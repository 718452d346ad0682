"""Indirect methods: the minimum principle as a boundary value problem."""
