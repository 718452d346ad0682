"""One check a file: what may be wrong with a problem or an answer."""
