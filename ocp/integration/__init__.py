"""One-step integrators: state and cost after one interval, with derivatives."""
