"""What stands in an expression beside formulas: tables, networks, functions that are called."""
