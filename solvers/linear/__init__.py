"""Linear dynamics, quadratic cost: recursions and quadratic programs."""
