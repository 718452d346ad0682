"""What is compared: solvers with the start they are given."""
