/* A step of the control loop: predict, solve, read the input off the plan. */

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

export_status export_sent(void *workspace, const double *u) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (!u) return EXPORT_NULL;
  if (!all_finite(u, INPUTS)) return EXPORT_BAD_INPUT;
  send(workspace, u);
  return EXPORT_SOLVED;
}
