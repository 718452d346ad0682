"""What a solver promises, and what it returns."""
