/* A solve from the first guess of the problem or from a plan, and what its answer is worth. */

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
