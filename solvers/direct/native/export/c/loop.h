/* The functions of the interface: a control loop around the solver, in the units of the user.
 *
 * The block of a workspace is a Loop and behind it the block of the solver. What is generated
 * before this file: sizes, and how states, inputs and parameters of the user become those of the
 * solver (see problem_tables.py).
 */

#define LOOP_BYTES ((sizeof(Loop) + 63) / 64 * 64)
/* A plan whose state is further from the measured one, in sizes, is no start for the next. */
#define FAR_FROM_PLAN 100.0
/* A first trajectory explodes where its second half exceeds the first by this factor. */
#define EXPLODES 100.0
/* In that states below this share of the largest one count more. */
#define SMALL_SHARE 0.01
/* An answer beyond these is none, whatever the solver says of it. */
#define MOST_GRADIENT 1e-4
#define MOST_VIOLATION 1e-6
/* Instants that differ by this share of an interval are the same. */
#define SAME_STEP 1e-6

typedef struct {
  uint64_t magic; /* of this problem and version */
  int has_plan, has_input, is_pending, misses;
  double input[AT_LEAST_1(INPUTS)];                             /* the last one */
  double pending[AT_LEAST_1(DELAY_STEPS)][AT_LEAST_1(INPUTS)];  /* oldest first */
  double start[NX], user_start[USER_NX], parameters[AT_LEAST_1(USER_NP)];
  export_report report;
} Loop;

static Workspace *solver_of(const Loop *loop) {
  return (Workspace *)(void *)((char *)(uintptr_t)loop + LOOP_BYTES);
}

static int all_finite(const double *numbers, int count) {
  for (int i = 0; i < count; i++)
    if (!isfinite(numbers[i])) return 0;
  return 1;
}

/* result = constants + sum of weights times numbers. */
static void affine(const double *constants, int rows, const Term *terms, int count,
                   const double *numbers, double *result) {
  for (int i = 0; i < rows; i++) result[i] = constants[i];
  for (int i = 0; i < count; i++) result[terms[i].row] += terms[i].weight * numbers[terms[i].column];
}

/* What is wrong with a workspace; SOLVED: nothing. */
static export_status workspace_error(const void *workspace) {
  if (!workspace) return EXPORT_NULL;
  if ((uintptr_t)workspace % EXPORT_ALIGNMENT != 0) return EXPORT_MISALIGNED;
  return ((const Loop *)workspace)->magic == MAGIC ? EXPORT_SOLVED : EXPORT_FOREIGN_WORKSPACE;
}

/* What is wrong with the arguments of a solve. */
static export_status argument_error(const void *workspace, double t, const double *x,
                                    const double *parameters) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (!x || (!parameters && USER_NP > 0)) return EXPORT_NULL;
  if (!isfinite(t)) return EXPORT_BAD_TIME;
  if (!all_finite(x, USER_NX)) return EXPORT_BAD_MEASUREMENT;
  return all_finite(parameters, USER_NP) ? EXPORT_SOLVED : EXPORT_BAD_PARAMETER;
}

size_t export_workspace_bytes(void) { return LOOP_BYTES + export_core_bytes(INTERVALS); }

export_status export_init(void *workspace, size_t bytes) {
  if (!workspace) return EXPORT_NULL;
  if ((uintptr_t)workspace % EXPORT_ALIGNMENT != 0) return EXPORT_MISALIGNED;
  if (bytes < export_workspace_bytes()) return EXPORT_SMALL_WORKSPACE;
  Loop *loop = workspace;
  memset(loop, 0, LOOP_BYTES);
  export_core_set_up((char *)workspace + LOOP_BYTES, INTERVALS);
  Workspace *s = solver_of(loop);
  memcpy(s->sizes, state_sizes, sizeof state_sizes);
  memcpy(s->x_given, start_given, sizeof start_given);
  for (int k = 0; k < INTERVALS; k++)
    memcpy(s->u_given + (size_t)k * NU, control_given, sizeof(double) * NU);
  memcpy(s->low, lower_bounds, sizeof(double) * (size_t)s->rows);
  memcpy(s->up, upper_bounds, sizeof(double) * (size_t)s->rows);
  export_core_read_bounds((char *)s);
  loop->magic = MAGIC;
  return EXPORT_SOLVED;
}

export_status export_reset(void *workspace, const double *acting) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (acting && !all_finite(acting, INPUTS)) return EXPORT_BAD_INPUT;
  Loop *loop = workspace;
  memset(loop, 0, LOOP_BYTES);
  loop->magic = MAGIC;
  if (!acting || DELAY_STEPS == 0) return EXPORT_SOLVED;
  loop->has_input = 1;
  memcpy(loop->input, acting, sizeof(double) * INPUTS);
  for (int k = 0; k < DELAY_STEPS; k++)
    memcpy(loop->pending[k], acting, sizeof(double) * INPUTS);
  loop->is_pending = DELAY_STEPS;
  return EXPORT_SOLVED;
}

void export_declared(double *x, double *parameters) {
  if (x) memcpy(x, declared_start, sizeof(double) * USER_NX);
  if (parameters) memcpy(parameters, declared_parameters, sizeof(double) * USER_NP);
}

/* Keep the parameters of a step; the caller's array may be NULL where there are none. */
static void keep_parameters(Loop *loop, const double *parameters) {
  for (int i = 0; i < USER_NP; i++) loop->parameters[i] = parameters[i];
}

/* Write start, times and parameters of a solve into the solver. */
static void write_data(Loop *loop, double t, const double *x) {
  Workspace *s = solver_of(loop);
  double *start = loop->start;
  affine(start_constants, NX, start_of_state, COUNT(start_of_state), x, start);
  for (int i = 0; i < COUNT(start_of_parameters); i++) {
    const Term term = start_of_parameters[i];
    start[term.row] += term.weight * loop->parameters[term.column];
  }
  affine(data_constants, (INTERVALS + 1) * ND, data_of_parameters, COUNT(data_of_parameters),
         loop->parameters, s->data);
  for (int k = 0; k <= INTERVALS; k++) s->data[(size_t)k * ND] = t;
}

/* Whether a first trajectory is finite and stays of the size of its first half. */
static int is_tame(const Workspace *s) {
  double usual[NX], largest = 0.0;
  if (!all_finite(s->x, (INTERVALS + 1) * NX)) return 0;
  for (int i = 0; i < FORM_NX; i++) {
    usual[i] = bound_sizes[i];
    for (int k = 0; k <= (INTERVALS + 1) / 2; k++)
      usual[i] = fmax(usual[i], fabs(s->x[(size_t)k * NX + i]));
    largest = fmax(largest, usual[i]);
  }
  for (int i = 0; i < FORM_NX; i++)
    for (int k = 0; k <= INTERVALS; k++)
      if (fabs(s->x[(size_t)k * NX + i]) > EXPLODES * fmax(usual[i], SMALL_SHARE * largest)) return 0;
  return 1;
}

/* States of the first controls, from the start on; where they explode the start held. */
static void roll_out(Workspace *s) {
  for (int k = 0; k < INTERVALS; k++) {
    for (int lane = 0; lane < LANES; lane++) {
      int at = put(s->in, 0, lane, s->x + (size_t)k * NX, NX);
      at = put(s->in, at, lane, s->u + (size_t)k * NU, NU);
      put(s->in, at, lane, s->data + (size_t)k * ND, ND);
    }
    stage_value(s->in, s->out);
    get(s->out, 0, 0, s->x + (size_t)(k + 1) * NX, NX);
  }
  if (is_tame(s)) return;
  for (int k = 1; k <= INTERVALS; k++) memcpy(s->x + (size_t)k * NX, s->x, sizeof(double) * NX);
}

/* The first iterate: of the problem's guess, or of the plan that is kept. */
static void write_first_iterate(Loop *loop, int from_plan, double t) {
  Workspace *s = solver_of(loop);
  if (from_plan) {
    shift_plan(s, t, s->plan_t[INTERVALS] - s->plan_t[0]);
  } else {
    memcpy(s->x, first_states, sizeof first_states);
    memcpy(s->u, first_controls, sizeof(double) * INTERVALS * NU);
    memcpy(s->lambda, first_costates, sizeof first_costates);
  }
  for (int i = 0; i < NX; i++)
    if (!from_plan || start_given[i] != 0.0) s->x[i] = loop->start[i];
  if (!from_plan && !HAS_FIRST_STATES) roll_out(s);
  for (int k = 0; k < INTERVALS; k++)
    for (int i = 0; i < NU; i++)
      if (control_given[i] != 0.0) s->u[(size_t)k * NU + i] = given_controls[i];
  export_core_begin((char *)s);
}

/* What an ending of the solver means. */
static export_status status_of(Ending ending) {
  switch (ending) {
    case SOLVED: return EXPORT_SOLVED;
    case ITERATION_LIMIT: return EXPORT_ITERATION_LIMIT;
    case DIVERGED: return EXPORT_DIVERGED;
    default: return EXPORT_FAILED;
  }
}

/* Judge the answer of the solver, and note what it is worth. */
static void judge(Loop *loop, Ending ending, int iterations) {
  Workspace *s = solver_of(loop);
  Account account;
  export_report *report = &loop->report;
  export_core_account((char *)s, &account);
  report->status = status_of(ending);
  report->iterations = iterations;
  report->cost = s->cost * COST_SIZE;
  report->gradient = s->left.dual;
  report->violation = s->left.primal;
  report->integration_error = account.moved;
  if (ending != SOLVED) return;
  if (!(s->left.primal <= MOST_VIOLATION) ||
      !(s->left.dual <= MOST_GRADIENT * (1.0 + s->left.multiplier)))
    report->status = EXPORT_FAILED;
  else if (!IS_DISCRETE && !(account.moved <= ACCURACY))
    report->status = EXPORT_INACCURATE;
}

/* Solve, in ways that follow each other: from costates, from multipliers that are fitted, with a
 * barrier parameter that only falls. */
static void solve_in_ways(Loop *loop, int from_plan, double t) {
  Workspace *s = solver_of(loop);
  const int is_warm = from_plan || HAS_FIRST_COSTATES;
  int iterations = 0;
  Ending ending = NO_STEP;
  for (int way = is_warm ? 0 : 1; way < (s->sides > 0.0 ? 3 : 2); way++) {
    const Options options = {TOLERANCE,
                             way == 0 ? WARM_BARRIER : COLD_BARRIER,
                             MOST_ITERATIONS - iterations,
                             INFINITY,
                             INFINITY,
                             way == 0,
                             way == 2,
                             0.0};
    write_first_iterate(loop, from_plan, t);
    ending = (Ending)export_core_solve((char *)s, &options, 1);
    iterations += s->iteration;
    if (ending == SOLVED || ending == ITERATION_LIMIT || iterations >= MOST_ITERATIONS) break;
  }
  judge(loop, ending, iterations);
}

/* Keep the answer as the plan. */
static void keep_plan(Loop *loop, double t) {
  Workspace *s = solver_of(loop);
  const double length = HAS_FREE_TIME ? s->x[NX - 1] * TIME_UNIT : DURATION;
  for (int k = 0; k <= INTERVALS; k++) s->plan_t[k] = t + fractions[k] * length;
  memcpy(s->plan_x, s->x, sizeof(double) * (INTERVALS + 1) * NX);
  memcpy(s->plan_u, s->u, sizeof(double) * INTERVALS * NU);
  memcpy(s->plan_lambda, s->lambda, sizeof(double) * (INTERVALS + 1) * NX);
  loop->has_plan = 1;
}

static export_status solve_from(Loop *loop, int from_plan, double t, const double *x) {
  write_data(loop, t, x);
  solve_in_ways(loop, from_plan, t);
  if (loop->report.status == EXPORT_SOLVED) keep_plan(loop, t);
  return loop->report.status;
}

static export_status checked_solve(void *workspace, int is_warm, double t, const double *x,
                                   const double *parameters) {
  const export_status wrong = argument_error(workspace, t, x, parameters);
  if (wrong != EXPORT_SOLVED) return wrong;
  Loop *loop = workspace;
  keep_parameters(loop, parameters);
  return solve_from(loop, is_warm && loop->has_plan, t, x);
}

export_status export_solve(void *workspace, double t, const double *x, const double *parameters) {
  return checked_solve(workspace, 0, t, x, parameters);
}

export_status export_solve_warm(void *workspace, double t, const double *x,
                                const double *parameters) {
  return checked_solve(workspace, 1, t, x, parameters);
}

#if SENDS_RATE || DELAY_STEPS > 0
_Static_assert(USER_NX + USER_NU + 1 + USER_P <= MOST_IN, "the arguments fit into the memory");

/* Put a state, a control and t [s] into the solver's memory, with the parameters of the first
 * instant, for a function of (x, u, t, p). */
static void put_instant(Loop *loop, const double *x, const double *u, double t) {
  Workspace *s = solver_of(loop);
  double p[AT_LEAST_1(USER_P)];
  affine(now_constants, USER_P, now_of_parameters, COUNT(now_of_parameters), loop->parameters, p);
  for (int lane = 0; lane < LANES; lane++) {
    int at = put(s->in, 0, lane, x, USER_NX);
    at = put(s->in, at, lane, u, USER_NU);
    at = put(s->in, at, lane, &t, 1);
    put(s->in, at, lane, p, USER_P);
  }
}
#endif

#if DELAY_STEPS > 0
/* The user's state one sampling interval after t [s] under an input, parameters held. */
static void predict_state(Loop *loop, double t, const double *u, double *x) {
#if SENDS_RATE
  (void)loop, (void)t;
  for (int i = 0; i < USER_NX; i++) x[i] += SAMPLING * u[i];
#else
  put_instant(loop, x, u, t);
  interval(solver_of(loop)->in, solver_of(loop)->out);
  get(solver_of(loop)->out, 0, 0, x, USER_NX);
#endif
}
#endif

/* The controls that the plan has at t [s]. */
static void controls_of_plan(const Workspace *s, double t, double *u) {
  const double *nodes = s->plan_t, length = nodes[INTERVALS] - nodes[0];
  for (int i = 0; i < USER_NU; i++) {
    const int is_state = control_from[i] < FORM_NX;
    const double now = t + (is_state ? SAMPLING : BETWEEN);
    int k = 0;
    while (k < INTERVALS - 1 && nodes[k + 1] <= now + SAME_INSTANT * length) k++;
    if (is_state) {
      const double *below = s->plan_x + (size_t)k * NX + control_from[i];
      const double share = (fmin(now, nodes[INTERVALS]) - nodes[k]) / (nodes[k + 1] - nodes[k]);
      u[i] = below[0] + share * (below[NX] - below[0]);
    } else {
      u[i] = s->plan_u[(size_t)k * NU + control_from[i] - FORM_NX];
    }
    u[i] *= control_sizes[i];
  }
}

/* The input that the plan has for a state at t [s], within its bounds. */
static void input_of_plan(Loop *loop, double t, const double *x, double *u) {
  double controls[AT_LEAST_1(USER_NU)];
  controls_of_plan(solver_of(loop), t, controls);
#if SENDS_RATE
  put_instant(loop, x, controls, t);
  sent(solver_of(loop)->in, solver_of(loop)->out);
  get(solver_of(loop)->out, 0, 0, u, INPUTS);
#else
  (void)x;
  memcpy(u, controls, sizeof(double) * INPUTS);
#endif
  for (int i = 0; i < INPUTS; i++) u[i] = fmin(fmax(u[i], input_lower[i]), input_upper[i]);
}

/* The state that the plan has at t [s], in the units of the user. */
static void state_of_plan(const Workspace *s, double t, double *x) {
  int k = 0;
  while (k < INTERVALS - 1 && s->plan_t[k + 1] <= t) k++;
  const double share = (t - s->plan_t[k]) / (s->plan_t[k + 1] - s->plan_t[k]);
  for (int i = 0; i < USER_NX; i++) {
    const double *below = s->plan_x + (size_t)k * NX + i;
    x[i] = (below[0] + share * (below[NX] - below[0])) * user_scales[i];
  }
}

/* Whether the plan is of use as a first iterate for a state at t [s]. */
static int leads_on(const Loop *loop, double t, const double *x) {
  const Workspace *s = solver_of(loop);
  if (!loop->has_plan || (loop->misses > 0 && loop->misses % 2 == 0) || t < s->plan_t[0]) return 0;
  int k = 0;
  while (k < INTERVALS && s->plan_t[k + 1] <= t) k++;
  for (int i = 0; i < USER_NX; i++) {
    const double there = s->plan_x[(size_t)k * NX + i] * user_scales[i];
    if (!(fabs(there - x[i]) <= FAR_FROM_PLAN * (user_sizes[i] + fabs(x[i])))) return 0;
  }
  return 1;
}

/* Remember an input as sent. */
static void send(Loop *loop, const double *u) {
  memcpy(loop->input, u, sizeof(double) * INPUTS);
  loop->has_input = 1;
#if DELAY_STEPS > 0
  if (loop->is_pending == DELAY_STEPS) {
    for (int k = 1; k < DELAY_STEPS; k++)
      memcpy(loop->pending[k - 1], loop->pending[k], sizeof loop->pending[k]);
    loop->is_pending--;
  }
  memcpy(loop->pending[loop->is_pending++], u, sizeof(double) * INPUTS);
#endif
}

/* Write the input of the plan that is kept, where it reaches to t [s], for a state; NULL: the one
 * that the plan has then. */
static export_status follow_plan(Loop *loop, double t, const double *x, double *u) {
  const Workspace *s = solver_of(loop);
  const double rounding = SAME_STEP * SAMPLING;
  if (!loop->has_plan || t < s->plan_t[0] - rounding || t >= s->plan_t[INTERVALS] - rounding)
    return EXPORT_NO_PLAN;
  if (!x) state_of_plan(s, t, loop->user_start);
  input_of_plan(loop, t, loop->user_start, u);
  if (!all_finite(u, INPUTS)) return EXPORT_NO_PLAN;
  send(loop, u);
  return EXPORT_SHIFTED;
}

export_status export_feedback(void *workspace, double t, const double *x,
                              const double *parameters, double *u) {
  const export_status wrong = argument_error(workspace, t, x, parameters);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (!u) return EXPORT_NULL;
  Loop *loop = workspace;
  const double acts = t + DELAY;
  double *start = loop->user_start;
  memcpy(start, x, sizeof(double) * USER_NX);
  keep_parameters(loop, parameters);
  for (int i = 0; i < COUNT(last_inputs) && loop->has_input; i++)
    loop->parameters[last_inputs[i].row] = loop->input[last_inputs[i].column];
#if DELAY_STEPS > 0
  for (int k = 0; k < loop->is_pending && COMPENSATES; k++)
    predict_state(loop, t + k * SAMPLING, loop->pending[k], start);
#endif
  if (!all_finite(start, USER_NX)) {
    loop->misses++;
    loop->report = (export_report){.status = EXPORT_DIVERGED};
    return follow_plan(loop, acts, NULL, u);
  }
  const export_status status = solve_from(loop, leads_on(loop, acts, start), acts, start);
  loop->misses = status == EXPORT_SOLVED ? 0 : loop->misses + 1;
  if (status != EXPORT_SOLVED) return follow_plan(loop, acts, start, u);
  input_of_plan(loop, acts, start, u);
  send(loop, u);
  return EXPORT_SOLVED;
}

export_status export_follow(void *workspace, double t, double *u) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (!u) return EXPORT_NULL;
  if (!isfinite(t)) return EXPORT_BAD_TIME;
  const export_status status = follow_plan(workspace, t + DELAY, NULL, u);
  return status == EXPORT_SHIFTED ? EXPORT_SOLVED : status;
}

export_status export_plan(const void *workspace, double *t, double *x, double *u) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  const Loop *loop = workspace;
  const Workspace *s = solver_of(loop);
  if (!loop->has_plan) return EXPORT_NO_PLAN;
  for (int k = 0; k <= INTERVALS; k++) {
    const double *own = s->plan_x + (size_t)k * NX;
    if (t) t[k] = s->plan_t[k];
    for (int i = 0; i < USER_NX && x; i++) x[k * USER_NX + i] = own[i] * user_scales[i];
    for (int i = 0; i < USER_NU && u && k < INTERVALS; i++) {
      const int from = control_from[i];
      const double value = from < FORM_NX ? own[from] : s->plan_u[k * NU + from - FORM_NX];
      u[k * USER_NU + i] = value * control_sizes[i];
    }
  }
  return EXPORT_SOLVED;
}

export_status export_constants(const void *workspace, double *values) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (!values) return EXPORT_NULL;
  const Loop *loop = workspace;
  if (!loop->has_plan) return EXPORT_NO_PLAN;
  for (int i = 0; i < COUNT(constants); i++)
    values[i] = solver_of(loop)->plan_x[constants[i].row] * constants[i].weight;
  return EXPORT_SOLVED;
}

export_status export_last_report(const void *workspace, export_report *report) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (!report) return EXPORT_NULL;
  *report = ((const Loop *)workspace)->report;
  return EXPORT_SOLVED;
}
