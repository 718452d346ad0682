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

# Solvers against a case's reference: relative gap of the referee's cost, and violation.
# A control held on 75 intervals costs O(h^2) more than the optimal one; extremals of 300 RK4
# steps are as good as the integrator.
GAP = {"direct": 1e-3, "gradient": 1e-3, "indirect": 1e-6, "polish": 1e-6}
VIOLATION = {"direct": 1e-6, "gradient": 1e-12, "indirect": 1e-8, "polish": 1e-8}
# A reference is no minimum if a feasible answer costs less than it by this.
BELOW = 1e-7
# Two backends on the same nonlinear program, cost relative.
SAME_PROGRAM = 1e-6
# A direct answer (75 to 300 intervals) against an extremal, cost relative.
DIRECT_COST = 1e-4
# Costates of a direct answer at 200 intervals, relative to their largest component.
DIRECT_COSTATE = 1e-3
# Extremals polished until the cost holds to 1e-10.
CERTIFIED = 1e-8
RESIDUAL = 1e-10
