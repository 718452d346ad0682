"""A sweep: cases by methods, in processes that may hang or die, one line of results at a time."""
