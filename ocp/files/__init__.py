"""Files that are whole or not there: drafts, counted appends, checksums."""
