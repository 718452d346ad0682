"""Controllers, plants, and the simulated loop of the two."""
