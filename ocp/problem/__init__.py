"""The description of an optimal control problem, and what follows from it directly."""
