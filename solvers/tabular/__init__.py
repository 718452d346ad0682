"""Values on a grid, and one step ahead."""
