/* What is called from outside. Every function takes the caller's block, aligned to 64 bytes. */

/* Bytes of the block for n intervals. */
size_t native_bytes(int n) {
  Workspace empty;
  const char *end = lay_out(&empty, (char *)&empty, n);
  return (size_t)(end - (char *)&empty) + (sizeof(Workspace) + 63) / 64 * 64;
}

/* Lay the block out. */
void native_set_up(char *block, int n) {
  memset(block, 0, native_bytes(n));
  lay_out((Workspace *)block, block + (sizeof(Workspace) + 63) / 64 * 64, n);
}

/* Pointers to what the caller writes and reads, in this order. */
void native_arrays(char *block, double **arrays) {
  Workspace *s = (Workspace *)block;
  double *all[] = {s->x,      s->u,     s->lambda,  s->data,        s->low,     s->up,
                   s->v,      s->z_low, s->z_up,    s->y,           s->x_given, s->u_given,
                   s->has_low, s->has_up, s->is_equation, s->gap,   s->slope,   s->gradient,
                   s->hessian, s->c_slope, s->sigma, s->rhs,        s->dx,      s->du,
                   s->dlambda, s->sizes,  s->plan_t, s->plan_x,     s->plan_u,  s->plan_lambda,
                   s->half_step};
  memcpy(arrays, all, sizeof all);
}

/* Read the sides off the bounds; to be called after they have changed. */
void native_read_bounds(char *block) {
  Workspace *s = (Workspace *)block;
  s->sides = 0.0;
  for (int i = 0; i < s->rows; i++) {
    const double low = s->low[i], up = s->up[i];
    s->is_equation[i] = low == up;
    s->has_low[i] = !(low == up) && low > -INFINITY;
    s->has_up[i] = !(low == up) && up < INFINITY;
    s->sides += s->has_low[i] + s->has_up[i];
  }
  /* What is given is no unknown: its bounds are neither sides nor equations. */
  for (int k = 0; k <= s->n; k++)
    for (int b = 0; b < NB; b++) {
      const int i = rows_begin(k) + b, entry = bounded[b];
      const int given = entry < NU ? k == s->n || s->u_given[(size_t)k * NU + entry] != 0.0
                                   : k == 0 && s->x_given[entry - NU] != 0.0;
      if (!given) continue;
      s->sides -= s->has_low[i] + s->has_up[i];
      s->has_low[i] = s->has_up[i] = s->is_equation[i] = 0.0;
    }
  for (int i = 0; i < s->rows; i++) { /* infinity times no side would be no number */
    if (s->has_low[i] + s->is_equation[i] == 0.0) s->low[i] = 0.0;
    if (s->has_up[i] == 0.0) s->up[i] = 0.0;
  }
}

/* Write the plan, moved to begin at t0 [s], into x, u and lambda. */
void native_shift(char *block, double t0, double duration) {
  shift_plan((Workspace *)block, t0, duration);
}

/* Move x and u into their bounds, and keep u, for native_account(). */
void native_begin(char *block) {
  Workspace *s = (Workspace *)block;
  clip_to_bounds(s);
  memcpy(s->u_first, s->u, sizeof(double) * (size_t)s->n * NU);
}

/* Say what the answer is worth; move it into its bounds, which it may leave by the tolerance, and
 * write the costate of a given start. */
void native_account(char *block, Account *account) {
  Workspace *s = (Workspace *)block;
  clip_to_bounds(s);
  costate_of_start(s);
  account->moved = half_step_error(s, &account->node);
  account->unmoved = unmoved_controls(s);
}

/* Solve from the iterate in x, u and lambda; begin = 0: go on after PAUSED. */
int native_solve(char *block, const Options *options, int begin) {
  Workspace *s = (Workspace *)block;
  const Ending ending = iterate(s, options, begin);
  s->is_frozen = 0;
  return ending;
}

/* Freeze the program at the answer of a solve, for native_solve() with the option and another start
 * in x. */
void native_freeze(char *block) {
  Workspace *s = (Workspace *)block;
  evaluate_at_iterate(s, 1);
  freeze(s);
}

/* Evaluate the problem itself at the answer of a frozen program; native_report() then gives its
 * cost, and what it leaves of its conditions. */
void native_judge(char *block) {
  Workspace *s = (Workspace *)block;
  evaluate_at_iterate(s, 0);
  s->left = residuals(s, 0.0);
}

/* What a solve has come to. */
void native_report(const char *block, double *report) {
  const Workspace *s = (const Workspace *)block;
  const double all[] = {s->cost,           s->left.dual,      s->left.primal, s->left.product,
                        s->left.multiplier, s->iteration,     s->factorisations, s->evaluations,
                        s->values,         s->is_monotone,    s->shift,       s->mu,
                        s->seconds};
  memcpy(report, all, sizeof all);
}

/* Copy the notes, seven numbers an iteration; return how many iterations there are. */
int native_notes(const char *block, double *notes) {
  const Workspace *s = (const Workspace *)block;
  const int count = s->iteration < NOTED ? s->iteration + 1 : NOTED;
  memcpy(notes, s->notes, sizeof(Note) * (size_t)count);
  return count;
}

/* The gradient of the Lagrangian without given bounds of node 0 and of given controls:
 * what their multipliers balance, [n + 1][NW] in rhs. */
void native_gradient(char *block) {
  Workspace *s = (Workspace *)block;
  for (int i = 0; i < s->rows; i++) s->force[i] = s->z_up[i] - s->z_low[i] + s->y[i];
  for (int k = 0; k <= s->n; k++)
    lagrangian_gradient(s, k, s->force, s->rhs + (size_t)k * NW);
}

/* For tests: factorise slope, hessian, c_slope and sigma as they are, and solve for rhs and gap;
 * return whether all pivots are positive. */
int native_linear_step(char *block, double shift) {
  Workspace *s = (Workspace *)block;
  if (!factorise(s, shift)) return 0;
  solve_system(s, s->rhs, s->gap, s->dx, s->du, s->dlambda);
  return 1;
}

/* For checks: values and derivatives at x, u, lambda and the multipliers, up to an order; return
 * the cost. */
double native_evaluate(char *block, int order) {
  Workspace *s = (Workspace *)block;
  if (order == 0) return evaluate_values(s, s->x, s->u, s->gap, s->v);
  evaluate_at_iterate(s, order == 2);
  return s->cost;
}
