/* What every call returns. The first are ends of a solve, as in Python. */
typedef enum {
  /* The optimality conditions hold. */
  EXPORT_SOLVED = 0,
  /* They hold, but the integration is too coarse for the answer to mean anything. */
  EXPORT_INACCURATE = 1,
  /* Not converged within the limit of iterations. */
  EXPORT_ITERATION_LIMIT = 2,
  /* The iterates blew up. */
  EXPORT_DIVERGED = 3,
  /* No solution for another reason: no step was found, or a number was not finite. */
  EXPORT_FAILED = 4,
  /* Of a feedback: the solve failed, as the report says, and the input is that of the plan before. */
  EXPORT_SHIFTED = 5,
  /* There is no plan, or time has left it: no input was written. */
  EXPORT_NO_PLAN = 6,
  /* Refused before anything was done: nothing was written, the workspace is as it was. */
  EXPORT_NULL = 16,               /* a pointer is null */
  EXPORT_SMALL_WORKSPACE = 17,    /* fewer bytes than EXPORT_WORKSPACE_BYTES */
  EXPORT_MISALIGNED = 18,         /* its address is no multiple of EXPORT_ALIGNMENT */
  EXPORT_FOREIGN_WORKSPACE = 19,  /* not initialised, or by another problem or version */
  EXPORT_BAD_TIME = 20,           /* NaN or infinite */
  EXPORT_BAD_MEASUREMENT = 21,    /* the state has NaN or infinity */
  EXPORT_BAD_PARAMETER = 22,      /* a parameter is NaN or infinite */
  EXPORT_BAD_INPUT = 23           /* an input is NaN or infinite */
} export_status;

/* What the last solve has come to. */
typedef struct {
  export_status status;     /* how it ended */
  int iterations;           /* steps of all attempts */
  double cost;              /* of the plan, in the unit of the problem's cost */
  double gradient;          /* what the optimality conditions leave, largest entry */
  double violation;         /* largest violation of dynamics, bounds and constraints, in sizes */
  double integration_error; /* by how much half the step moves a state, relative */
} export_report;

/* Bytes that a workspace needs on this machine: at most EXPORT_WORKSPACE_BYTES. */
size_t export_workspace_bytes(void);

/* Make a workspace of a block of memory, which stays the caller's. Nothing else is written to by
 * any function, so that several workspaces may be used at once, each by one thread at a time. */
export_status export_init(void *workspace, size_t bytes);

/* Forget plan and inputs; `acting` (EXPORT_NU) is the input until the first feedback acts, NULL where
 * that is not known. */
export_status export_reset(void *workspace, const double *acting);

/* Write the start (EXPORT_NX) and the parameters (EXPORT_NP) as the problem declares them. */
void export_declared(double *x, double *parameters);

/* Solve from a state x at the time t [s], from the first guess of the problem. The plan is kept
 * where the return code is EXPORT_SOLVED, else the one before. */
export_status export_solve(void *workspace, double t, const double *x, const double *parameters);

/* The same from the plan that is kept, moved to t; from the first guess where there is none. */
export_status export_solve_warm(void *workspace, double t, const double *x,
                                const double *parameters);

/* One step of the control loop: the input u for a state x that was measured at t [s].
 *
 * The state is predicted over the delay with the inputs that are on their way; the solve starts from
 * the plan before; the input is clipped to its bounds. After a failure the input is that of the plan
 * before (EXPORT_SHIFTED), or none (EXPORT_NO_PLAN). To be called once a sampling interval. */
export_status export_feedback(void *workspace, double t, const double *x,
                              const double *parameters, double *u);

/* A step without a measurement: the input of the plan that is kept, for the time t [s]. It counts
 * as sent. */
export_status export_follow(void *workspace, double t, double *u);

/* Say what was sent where a step wrote no input, so that the next one predicts with that. */
export_status export_sent(void *workspace, const double *u);

/* Read the plan that is kept: instants [s] (EXPORT_N + 1), states (EXPORT_N + 1, EXPORT_NX) node by
 * node, controls of the intervals (EXPORT_N, EXPORT_CONTROLS). What is NULL is left out. */
export_status export_plan(const void *workspace, double *t, double *x, double *u);

/* Read the unknown constants of the plan that is kept (EXPORT_CONSTANTS). */
export_status export_constants(const void *workspace, double *values);

/* Say what the last solve has come to. */
export_status export_last_report(const void *workspace, export_report *report);
