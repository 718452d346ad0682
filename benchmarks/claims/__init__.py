"""What the toolkit claims of itself, checked against the rows of a run."""
