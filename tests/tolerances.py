"""The one table of tolerances. A test that needs another one says why on its line."""

# Two ways to the same number in floating point, a handful of operations apart.
ROUNDING = 1e-12
# Central differences with STEP of functions of order one (STEP^2 plus rounding / STEP).
STEP = 1e-5
DERIVATIVE = 1e-7
# One-sided or central differences of a whole optimisation, which is itself solved to 1e-9.
COST_STEP = 1e-3
COST_DERIVATIVE = 1e-5
# The referee against CVODES at 1e-11: both refine to about 1e-9.
REFEREE = 1e-8
# A root or minimiser of H against brute force (a minimiser is flat: sqrt of its cost's).
MINIMISER = 1e-6
# Slope of log(error) over log(step) may miss the integer order by this.
ORDER = 0.25
# Stationarity at an optimum that a solver reached to its own 1e-9.
STATIONARY = 1e-6
# Stationarity that is clearly not an optimum.
NOT_STATIONARY = 1e-2
