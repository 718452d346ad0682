"""Say what is wrong with a problem: one check a file, each naming what it found."""
