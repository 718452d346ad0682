"""The problem library: one suite, grouped by what makes a problem what it is."""
