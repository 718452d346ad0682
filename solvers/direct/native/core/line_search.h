/* How far to go along a step: a filter of infeasibility theta and barrier cost phi.
 *
 * A trial iterate is accepted where it has less of either than the iterate and than every pair in
 * the filter, by a margin; where infeasibility is small and the step promises descent, by Armijo's
 * condition on phi. Source: [Waechter & Biegler 2006].
 */

#define MARGIN 1e-5
#define ARMIJO 1e-4

/* Sum of all infeasibility, for slacks after a share a of the step. */
static double infeasibility(const Workspace *s, const double *gap, const double *v, double a) {
  double sum = 0.0;
  for (int i = 0; i < s->n * NX; i++) sum += fabs(gap[i]);
  for (int i = 0; i < s->rows; i++) {
    sum += s->has_low[i] * fabs(v[i] - s->low[i] - s->s_low[i] - a * s->ds_low[i]);
    sum += s->has_up[i] * fabs(s->up[i] - v[i] - s->s_up[i] - a * s->ds_up[i]);
    sum += s->is_equation[i] * fabs(v[i] - s->low[i]);
  }
  return sum;
}

/* Sum of the logarithms of all slacks after a share a of the step; the slack of no side is 1. */
static double logarithms(const Workspace *s, double a) {
  double sum = 0.0, product = 1.0;
  for (int i = 0; i < s->rows; i++) {
    /* Few logarithms of products instead of many: as long as they are neither huge nor tiny. */
    product *= (s->s_low[i] + a * s->ds_low[i]) * (s->s_up[i] + a * s->ds_up[i]);
    if (!(product > 1e-200 && product < 1e200)) {
      sum += log(product);
      product = 1.0;
    }
    if (product < 1e-100 || product > 1e100) {
      sum += log(product);
      product = 1.0;
    }
  }
  return sum + log(product);
}

/* Derivative of the barrier cost along the step. */
static double slope_of_cost(const Workspace *s, double mu) {
  double sum = 0.0;
  for (int k = 0; k <= s->n; k++) {
    const double *g = s->gradient + (size_t)k * NW;
    for (int i = 0; i < NU && k < s->n; i++) sum += g[i] * s->du[(size_t)k * NU + i];
    for (int i = 0; i < NX; i++) sum += g[NU + i] * s->dx[(size_t)k * NX + i];
  }
  for (int i = 0; i < s->rows; i++)
    sum -= mu * (s->ds_low[i] / s->s_low[i] + s->ds_up[i] / s->s_up[i]);
  return sum;
}

static int filter_accepts(const Workspace *s, double theta, double phi) {
  for (int i = 0; i < s->filter_size; i++)
    if (theta >= s->filter_theta[i] && phi >= s->filter_phi[i]) return 0;
  return 1;
}

static void filter_add(Workspace *s, double theta, double phi) {
  if (s->filter_size == FILTER) {
    s->filter_size--;
    memmove(s->filter_theta, s->filter_theta + 1, sizeof(double) * s->filter_size);
    memmove(s->filter_phi, s->filter_phi + 1, sizeof(double) * s->filter_size);
  }
  s->filter_theta[s->filter_size] = theta;
  s->filter_phi[s->filter_size++] = phi;
}

/* Evaluate the trial iterate after a share a of the step. */
static double evaluate_trial(Workspace *s, double a) {
  for (int i = 0; i < (s->n + 1) * NX; i++) s->x_trial[i] = s->x[i] + a * s->dx[i];
  for (int i = 0; i < s->n * NU; i++) s->u_trial[i] = s->u[i] + a * s->du[i];
  return values_of_program(s, s->x_trial, s->u_trial, s->gap_trial, s->v_trial);
}

/* Return an accepted share of the step, at most `longest` and at least `shortest`, or 0. */
static double line_search(Workspace *s, double longest, double shortest) {
  const double slope = slope_of_cost(s, s->mu);
  const double theta = infeasibility(s, s->gap, s->v, 0.0);
  const double phi = s->cost - s->mu * logarithms(s, 0.0);
  const double rounding = 1e-13 * (1.0 + fabs(phi) + s->left.multiplier * theta);
  if (s->largest_theta == 0.0) s->largest_theta = 1e4 * fmax(1.0, theta);
  for (double a = longest; a >= shortest; a *= 0.5) {
    const double cost = evaluate_trial(s, a);
    const double theta_a = infeasibility(s, s->gap_trial, s->v_trial, a);
    const double phi_a = cost - s->mu * logarithms(s, a);
    if (!isfinite(theta_a) || !isfinite(phi_a) || theta_a > s->largest_theta) continue;
    const int promises = slope < 0.0 && a * pow(-slope, 2.3) > pow(theta, 1.1);
    int accepted;
    if (theta < 1e-9 || promises)
      accepted = phi_a <= phi + ARMIJO * a * fmin(slope, 0.0) + rounding ||
                 (!promises && theta_a <= (1.0 - MARGIN) * theta);
    else
      accepted = theta_a <= (1.0 - MARGIN) * theta || phi_a <= phi - MARGIN * theta + rounding;
    if (accepted && theta_a >= 1e-9) accepted = filter_accepts(s, theta_a, phi_a - rounding);
    if (!accepted) continue;
    if (s->is_monotone && !promises)
      filter_add(s, (1.0 - MARGIN) * theta, phi - MARGIN * theta);
    s->cost_trial = cost;
    return a;
  }
  return 0.0;
}
