"""What a user may write, in the simpler terms that every method takes."""
