"""Rows condensed to tables."""
