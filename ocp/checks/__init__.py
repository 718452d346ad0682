"""Checks of arguments and expressions, and the exceptions they raise."""
