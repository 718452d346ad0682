"""Newton's method on multiple shooting, solved by a Riccati recursion."""
