"""A problem on a grid as a nonlinear program, and what each of its rows means."""
