"""Model predictive control: solve, check, apply, and what to apply when that fails."""
