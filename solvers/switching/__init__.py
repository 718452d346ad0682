"""Controls that take only listed values: relaxed, then rounded, with a bound on what that costs."""
