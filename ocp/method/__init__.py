"""One run for all methods: solve, then compare a success with the referee."""
