"""Dynamic programming, greedy control and generalised predictive control."""
