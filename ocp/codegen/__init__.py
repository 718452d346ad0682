"""CasADi Functions as machine code, and called with arrays."""
