"""Pages of the documentation whose code runs."""
