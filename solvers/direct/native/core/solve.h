/* The iteration: residuals, barrier parameter, step, line search. */

/* The barrier parameter falls no further than this share of the tolerance. */
#define FLOOR 0.1
/* Multipliers keep within this factor of mu / slack. */
#define SPREAD 1e10
/* In so many iterations without a smaller error the barrier parameter becomes monotone. */
#define PATIENCE 8
/* First multipliers beyond this are not used. */
#define HUGE_MULTIPLIER 1e3
/* An unknown beyond this has diverged. */
#define FAR 1e20

static double clock_seconds(void) {
#ifdef NO_CLOCK
  return 0.0;
#else
  struct timespec now;
#ifdef CLOCK_MONOTONIC
  clock_gettime(CLOCK_MONOTONIC, &now);
#else
  timespec_get(&now, TIME_UTC);
#endif
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
#endif
}

static double least(double a, double b) { return a < b ? a : b; }

/* Slack and multiplier of one side at a distance from its bound. */
static void start_side(double distance, double width, double mu, int warm, double *slack,
                       double *multiplier) {
  if (!warm) {
    *slack = fmax(distance, 1e-2 * least(1.0, width));
    *multiplier = mu / *slack;
    return;
  }
  /* Active or not, as the larger of the two says, so that the product is mu. */
  const double own = distance < 1e-2 * least(1.0, width) ? *multiplier : 0.0;
  if (own > distance) {
    *multiplier = fmax(own, sqrt(mu));
    *slack = mu / *multiplier;
  } else {
    *slack = fmax(distance, least(sqrt(mu), 1e-2 * width));
    *multiplier = mu / *slack;
  }
}

/* Costates and multipliers of equations that leave as little of the gradient as they can, in the
 * least squares: the Newton step of a program whose Hessian is the unit matrix. Where they are
 * huge, as where equations depend on each other, 0. Needs evaluate_at_iterate(), and slacks. */
static void fit_multipliers(Workspace *s) {
  for (int k = 0; k <= s->n; k++)
    for (int i = 0; i < NW * NW; i++)
      s->hessian[(size_t)k * NW * NW + i] = i % (NW + 1) == 0 ? 1.0 : 0.0;
  for (int i = 0; i < s->rows; i++) {
    s->force[i] = s->z_up[i] - s->z_low[i];
    s->sigma[i] = s->is_equation[i] / RELAX;
    s->y[i] = 0.0;
  }
  if (!factorise(s, 0.0)) return;
  for (int k = 0; k <= s->n; k++)
    lagrangian_gradient(s, k, s->force, s->rhs + (size_t)k * NW);
  solve_system(s, s->rhs, NULL, s->dx, s->du, s->dlambda);
  along_rows(s, s->dx, s->du, s->dv);
  double largest = 0.0;
  for (int i = NX; i < (s->n + 1) * NX; i++) largest = larger(largest, fabs(s->dlambda[i]));
  for (int i = 0; i < s->rows; i++) {
    s->dy[i] = s->is_equation[i] * s->dv[i] / RELAX;
    largest = larger(largest, fabs(s->dy[i]));
  }
  if (!(largest <= HUGE_MULTIPLIER)) return;
  for (int i = NX; i < (s->n + 1) * NX; i++) s->lambda[i] = s->dlambda[i];
  for (int i = 0; i < s->rows; i++) s->y[i] = s->dy[i];
}

/* Slacks and multipliers at the first iterate; warm: from the costates, where bounds are active. */
static void start_barrier(Workspace *s, double mu, int warm) {
  for (int i = 0; i < s->rows; i++) {
    s->y[i] = s->z_low[i] = s->z_up[i] = 0.0;
    s->s_low[i] = s->s_up[i] = 1.0;
    s->ds_low[i] = s->ds_up[i] = s->dz_low[i] = s->dz_up[i] = 0.0;
    s->corr_low[i] = s->corr_up[i] = 0.0;
  }
  evaluate_at_iterate(s, 1);
  for (int i = 0; i < s->rows; i++) s->force[i] = 0.0;
  for (int k = 0; k <= s->n; k++) {
    double g[NW];
    lagrangian_gradient(s, k, s->force, g);
    for (int b = 0; b < NB && warm; b++) {
      const int i = rows_begin(k) + b;
      s->z_low[i] = fmax(g[bounded[b]], 0.0);
      s->z_up[i] = fmax(-g[bounded[b]], 0.0);
      if (s->is_equation[i] != 0.0) s->y[i] = -g[bounded[b]];
    }
  }
  for (int i = 0; i < s->rows; i++) {
    const double width = s->has_low[i] * s->has_up[i] != 0.0 ? s->up[i] - s->low[i] : INFINITY;
    if (s->has_low[i] != 0.0)
      start_side(s->v[i] - s->low[i], width, mu, warm, &s->s_low[i], &s->z_low[i]);
    else
      s->z_low[i] = 0.0;
    if (s->has_up[i] != 0.0)
      start_side(s->up[i] - s->v[i], width, mu, warm, &s->s_up[i], &s->z_up[i]);
    else
      s->z_up[i] = 0.0;
  }
  if (warm) return; /* the Hessian has had the costates */
  fit_multipliers(s);
  evaluate_at_iterate(s, 1);
}

/* Slack and multiplier of one side as an earlier solve has left them, but not closer to 0 than a
 * barrier parameter; active or not as the larger of the two says. */
static void keep_side(double mu, double *slack, double *multiplier) {
  if (*multiplier > *slack) {
    *multiplier = fmax(*multiplier, sqrt(mu));
    *slack = mu / *multiplier;
  } else {
    *slack = fmax(*slack, sqrt(mu));
    *multiplier = mu / *slack;
  }
}

/* Begin the frozen program where it was frozen, with the multipliers that were found there. */
static void start_frozen(Workspace *s, double mu) {
  go_back(s);
  for (int i = 0; i < s->rows; i++) {
    s->ds_low[i] = s->ds_up[i] = s->dz_low[i] = s->dz_up[i] = 0.0;
    s->corr_low[i] = s->corr_up[i] = 0.0;
    if (s->has_low[i] != 0.0) keep_side(mu, &s->s_low[i], &s->z_low[i]);
    if (s->has_up[i] != 0.0) keep_side(mu, &s->s_up[i], &s->z_up[i]);
  }
  evaluate_program(s, 1);
}

/* Take a share of the step in x, u, lambda, y and slacks, and another one in z. */
static void accept(Workspace *s, double primal, double dual) {
  for (int i = 0; i < (s->n + 1) * NX; i++) {
    s->x[i] += primal * s->dx[i];
    s->lambda[i] += i < NX ? 0.0 : primal * s->dlambda[i];
  }
  for (int i = 0; i < s->n * NU; i++) s->u[i] += primal * s->du[i];
  for (int i = 0; i < s->rows; i++) {
    s->y[i] += primal * s->dy[i];
    s->s_low[i] += primal * s->ds_low[i];
    s->s_up[i] += primal * s->ds_up[i];
    s->z_low[i] += dual * s->dz_low[i];
    s->z_up[i] += dual * s->dz_up[i];
    if (s->has_low[i] != 0.0) {
      const double mean = s->mu / s->s_low[i];
      s->z_low[i] = fmin(fmax(s->z_low[i], mean / SPREAD), mean * SPREAD);
    }
    if (s->has_up[i] != 0.0) {
      const double mean = s->mu / s->s_up[i];
      s->z_up[i] = fmin(fmax(s->z_up[i], mean / SPREAD), mean * SPREAD);
    }
  }
}

/* From here on the barrier parameter only falls, and the filter remembers. */
static void become_monotone(Workspace *s) {
  s->is_monotone = 1;
  s->mu = fmin(fmax(s->left.mean_product, 1e-6), 1e2);
  s->filter_size = 0;
}

/* Lower a monotone barrier parameter as long as its own problem is solved well enough. */
static void lower_barrier(Workspace *s, double floor) {
  while (s->mu > floor) {
    const Residuals left = residuals(s, s->mu);
    if (!(error_of(&left) <= 10.0 * s->mu)) return;
    s->mu = fmax(floor, fmin(0.2 * s->mu, pow(s->mu, 1.5)));
    s->filter_size = 0;
  }
}

/* Factorise, with as small a shift as makes all pivots positive; return whether there is one. */
static int factorise_shifted(Workspace *s, double shift) {
  while (!factorise(s, shift)) {
    if (shift == 0.0)
      shift = s->last_shift > 0.0 ? fmax(1e-10, s->last_shift / 3.0) : 1e-4;
    else
      shift *= s->last_shift > 0.0 ? 8.0 : 100.0;
    if (!(shift < 1e30)) return 0;
  }
  s->shift = shift;
  if (shift > 0.0) s->last_shift = shift;
  return 1;
}

/* Set the barrier parameter by a predictor, and its correction (Mehrotra). */
static void predict(Workspace *s, double floor) {
  double primal, dual;
  newton_step(s, 0.0, 0);
  longest(s, 1.0, &primal, &dual);
  const double ratio = mean_product_after(s, primal, dual) / s->left.mean_product;
  s->mu = fmax(floor, fmin(ratio * ratio * ratio, 1.0) * s->left.mean_product);
  for (int i = 0; i < s->rows; i++) {
    s->corr_low[i] = s->ds_low[i] * s->dz_low[i];
    s->corr_up[i] = s->ds_up[i] * s->dz_up[i];
  }
}

/* One step from the iterate: predictor-corrector; if that is rejected Newton's, then with larger
 * and larger shifts, then with a monotone barrier. Return whether one was accepted. */
static int step(Workspace *s, double floor) {
  double shift = 0.0;
  for (int attempt = 0; attempt < 14; attempt++) {
    if (!factorise_shifted(s, shift)) return 0;
    const int corrected = s->sides > 0.0 && !s->is_monotone && attempt == 0;
    if (s->sides > 0.0 && !s->is_monotone) predict(s, floor);
    newton_step(s, s->mu, corrected);
    double primal = 1.0, dual = 1.0;
    if (s->sides > 0.0) longest(s, fmax(0.99, 1.0 - s->mu), &primal, &dual);
    const double a = line_search(s, primal, (corrected ? 0.3 : 1e-6) * primal);
    if (a > 0.0) {
      accept(s, a, dual);
      s->length = a;
      return 1;
    }
    if (attempt == 0 && corrected) continue;
    shift = fmax(1e-4, 10.0 * s->shift);
    if (attempt >= 3 && s->sides > 0.0 && !s->is_monotone) {
      become_monotone(s);
      shift = 0.0;
    }
  }
  return 0;
}

/* Whether an unknown has diverged. */
static int is_far(const Workspace *s) {
  for (int i = 0; i < (s->n + 1) * NX; i++)
    if (!(fabs(s->x[i]) < FAR)) return 1;
  for (int i = 0; i < s->n * NU; i++)
    if (!(fabs(s->u[i]) < FAR)) return 1;
  return 0;
}

/* Note what an iteration begins with, and the step that led there. */
static void note(Workspace *s) {
  const int at = s->iteration < NOTED ? s->iteration : NOTED - 1;
  s->notes[at] = (Note){s->cost, s->left.primal, s->left.dual, s->left.product,
                        s->mu,   s->shift,       s->length};
}

/* Iterate until an end or a pause, which is after an iteration, so that each call gets further;
 * PAUSED: call it again with begin = 0. */
static Ending iterate(Workspace *s, const Options *o, int begin) {
  const double started = clock_seconds(), before = begin ? 0.0 : s->seconds;
  const double floor = FLOOR * o->tolerance;
  s->is_frozen = o->frozen != 0.0;
  if (begin) {
    const int warm = o->warm != 0.0;
    s->mu = o->barrier;
    s->shift = s->last_shift = s->largest_theta = 0.0;
    s->iteration = s->is_monotone = s->filter_size = 0;
    s->factorisations = s->evaluations = s->values = 0;
    s->length = 1.0;
    s->seconds = 0.0;
    s->best = INFINITY;
    s->since_best = 0;
    if (o->monotone != 0.0) s->is_monotone = 1;
    if (!warm) memset(s->lambda, 0, sizeof(double) * (size_t)(s->n + 1) * NX);
    if (s->is_frozen)
      start_frozen(s, s->mu);
    else
      start_barrier(s, s->mu, warm);
  }
  for (;;) {
    weigh(s);
    s->left = residuals(s, 0.0);
    note(s);
    const double error = error_of(&s->left);
    if (!isfinite(error) || !isfinite(s->cost)) return is_far(s) ? DIVERGED : NOT_FINITE;
    if (error <= o->tolerance) return SOLVED;
    if (s->iteration >= o->max_iterations) return ITERATION_LIMIT;
    if (is_far(s)) return DIVERGED;
    s->seconds = before + clock_seconds() - started;
    if (s->seconds > o->time_limit) return TIME_LIMIT;
    if (!s->has_hessian) evaluate_at_iterate(s, 1);
    s->since_best = error < 0.9999 * s->best ? 0 : s->since_best + 1;
    s->best = least(s->best, error);
    if (s->sides > 0.0 && !s->is_monotone && s->since_best >= PATIENCE) become_monotone(s);
    if (s->is_monotone) lower_barrier(s, floor);
    if (!step(s, floor)) return NO_STEP;
    s->iteration++;
    /* Where this step was the last one, as Newton's method promises, no more is needed. */
    const int goes_on = error > sqrt(o->tolerance) || s->length < 1.0 || s->mu > 10.0 * floor;
    evaluate_program(s, goes_on);
    s->seconds = before + clock_seconds() - started;
    if (s->seconds - before >= o->pause) return PAUSED;
  }
}
