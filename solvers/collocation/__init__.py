"""Direct collocation: states and controls as polynomials, the dynamics met at points of theirs."""
