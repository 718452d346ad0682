/* Slacks, multipliers, and what they make of the Newton step.
 *
 * Every finite side of a constrained quantity v (a bound, a row) has a slack and a multiplier,
 *
 *   v - low = s_low,  up - v = s_up,   s z = mu,   s > 0,  z > 0,
 *
 * and an equation v = low has a multiplier y of either sign. The Lagrangian is
 * cost + lambda'(F - x') + (z_up - z_low + y)'v, as of casadi.nlpsol. Elimination of slacks and
 * multipliers from the Newton step leaves, with the residuals r = v - low - s_low, ...,
 *
 *   dz_low = (mu - corr - z ds)/s - z,  ds_low = dv + r_low,  ds_up = -dv + r_up,
 *   sigma = z_low/s_low + z_up/s_up,
 *   force = (z r - mu + corr)_low/s_low - (z r - mu + corr)_up/s_up
 *
 * as weight and pull of v; corr = ds dz of the predictor (Mehrotra). An equation is regularised,
 * dv + r - RELAX dy = 0, so that it is a weight too, and dependent equations are no failure; the
 * step is then refined until dv + r = 0 (see refine).
 */

/* Regularisation of equations. */
#define RELAX 1e-8

/* The larger one; NaN stays, which fmax would hide. */
static double larger(double a, double b) { return b > a || b != b ? b : a; }

/* Residuals of slacks and equations, and the weights. */
static void weigh(Workspace *s) {
  for (int i = 0; i < s->rows; i++) {
    s->r_low[i] = s->has_low[i] * (s->v[i] - s->low[i] - s->s_low[i]);
    s->r_up[i] = s->has_up[i] * (s->up[i] - s->v[i] - s->s_up[i]);
    s->r_y[i] = s->is_equation[i] * (s->v[i] - s->low[i]);
    s->sigma[i] = s->z_low[i] / s->s_low[i] + s->z_up[i] / s->s_up[i] + s->is_equation[i] / RELAX;
  }
}

/* Pull of every quantity for a barrier parameter, with or without the predictor's correction. */
static void pull(Workspace *s, double mu, int corrected) {
  for (int i = 0; i < s->rows; i++) {
    const double low = mu - (corrected ? s->corr_low[i] : 0.0);
    const double up = mu - (corrected ? s->corr_up[i] : 0.0);
    s->force[i] = s->has_low[i] * (s->z_low[i] * s->r_low[i] - low) / s->s_low[i] -
                  s->has_up[i] * (s->z_up[i] * s->r_up[i] - up) / s->s_up[i] +
                  s->is_equation[i] * (s->y[i] + s->r_y[i] / RELAX);
  }
}

/* Add c_w' weights of node k to g (NW). */
static void add_rows(const Workspace *s, int k, const double *weights, double *g) {
  const double *own = weights + rows_begin(k), *c_slope = slopes_of_rows(s, k);
  for (int b = 0; b < NB; b++) g[bounded[b]] += own[b];
  for (int r = 0; r < rows_of(s, k); r++)
    for (int i = 0; i < NW; i++) g[i] += own[NB + r] * c_slope[(size_t)r * NW + i];
}

/* l_w + F_w' lambda' - lambda + c_w' weights of node k; nothing is known of lambda_0. */
static void lagrangian_gradient(const Workspace *s, int k, const double *weights, double *g) {
  memcpy(g, s->gradient + (size_t)k * NW, sizeof(double) * NW);
  if (k > 0)
    for (int i = 0; i < NX; i++) g[NU + i] -= s->lambda[(size_t)k * NX + i];
  if (k < s->n) {
    const double *F = s->slope + (size_t)k * NX * NW, *lambda = s->lambda + (size_t)(k + 1) * NX;
    for (int j = 0; j < NX; j++)
      for (int i = 0; i < NW; i++) g[i] += lambda[j] * F[j * NW + i];
  }
  add_rows(s, k, weights, g);
}

/* dv = c_w dw. */
static void along_rows(const Workspace *s, const double *dx, const double *du, double *dv) {
  for (int k = 0; k <= s->n; k++) {
    double dw[NW], *own = dv + rows_begin(k);
    const double *c_slope = slopes_of_rows(s, k);
    for (int i = 0; i < NU; i++) dw[i] = k < s->n ? du[(size_t)k * NU + i] : 0.0;
    for (int i = 0; i < NX; i++) dw[NU + i] = dx[(size_t)k * NX + i];
    for (int b = 0; b < NB; b++) own[b] = dw[bounded[b]];
    for (int r = 0; r < rows_of(s, k); r++) {
      double sum = 0.0;
      for (int i = 0; i < NW; i++) sum += c_slope[(size_t)r * NW + i] * dw[i];
      own[NB + r] = sum;
    }
  }
}

/* Solve again for what RELAX has left of the equations, and add it to the step. */
static void refine(Workspace *s) {
  double before = INFINITY;
  for (int pass = 0; pass < 3; pass++) {
    double left = 0.0;
    for (int i = 0; i < s->rows; i++) {
      const double e = s->is_equation[i] * (s->r_y[i] + s->dv[i]);
      s->force[i] = e / RELAX;
      left = larger(left, fabs(e));
    }
    if (!(left > 1e-14) || !(left < 0.25 * before)) return;
    before = left;
    for (int k = 0; k <= s->n; k++) {
      memset(s->rhs + (size_t)k * NW, 0, sizeof(double) * NW);
      add_rows(s, k, s->force, s->rhs + (size_t)k * NW);
    }
    solve_system(s, s->rhs, NULL, s->ex, s->eu, s->elambda);
    along_rows(s, s->ex, s->eu, s->ey);
    for (int i = 0; i < s->rows; i++) {
      s->dy[i] += s->is_equation[i] * (s->force[i] + s->ey[i] / RELAX);
      s->dv[i] += s->ey[i];
    }
    for (int i = 0; i < (s->n + 1) * NX; i++) {
      s->dx[i] += s->ex[i];
      s->dlambda[i] += s->elambda[i];
    }
    for (int i = 0; i < s->n * NU; i++) s->du[i] += s->eu[i];
  }
}

/* The whole step for a barrier parameter. */
static void newton_step(Workspace *s, double mu, int corrected) {
  pull(s, mu, corrected);
  for (int k = 0; k <= s->n; k++)
    lagrangian_gradient(s, k, s->force, s->rhs + (size_t)k * NW);
  solve_system(s, s->rhs, s->gap, s->dx, s->du, s->dlambda);
  along_rows(s, s->dx, s->du, s->dv);
  double equations = 0.0;
  for (int i = 0; i < s->rows; i++) {
    s->dy[i] = s->is_equation[i] * (s->r_y[i] + s->dv[i]) / RELAX;
    equations += s->is_equation[i];
  }
  if (equations > 0.0) refine(s);
  for (int i = 0; i < s->rows; i++) {
    const double low = mu - (corrected ? s->corr_low[i] : 0.0);
    const double up = mu - (corrected ? s->corr_up[i] : 0.0);
    s->ds_low[i] = s->has_low[i] * (s->dv[i] + s->r_low[i]);
    s->ds_up[i] = s->has_up[i] * (s->r_up[i] - s->dv[i]);
    s->dz_low[i] =
        s->has_low[i] * ((low - s->z_low[i] * s->ds_low[i]) / s->s_low[i] - s->z_low[i]);
    s->dz_up[i] = s->has_up[i] * ((up - s->z_up[i] * s->ds_up[i]) / s->s_up[i] - s->z_up[i]);
  }
}

/* Longest steps, at most 1, that leave slacks and multipliers 1 - tau of themselves. */
static void longest(const Workspace *s, double tau, double *primal, double *dual) {
  double p = tau, d = tau;
  for (int i = 0; i < s->rows; i++) {
    p = fmax(p, fmax(-s->ds_low[i] / s->s_low[i], -s->ds_up[i] / s->s_up[i]));
    if (s->has_low[i] != 0.0) d = fmax(d, -s->dz_low[i] / s->z_low[i]);
    if (s->has_up[i] != 0.0) d = fmax(d, -s->dz_up[i] / s->z_up[i]);
  }
  *primal = tau / p;
  *dual = tau / d;
}

/* Mean of slack times multiplier after a step. */
static double mean_product_after(const Workspace *s, double primal, double dual) {
  double sum = 0.0;
  for (int i = 0; i < s->rows; i++) {
    sum += s->has_low[i] * (s->s_low[i] + primal * s->ds_low[i]) *
           (s->z_low[i] + dual * s->dz_low[i]);
    sum += s->has_up[i] * (s->s_up[i] + primal * s->ds_up[i]) * (s->z_up[i] + dual * s->dz_up[i]);
  }
  return sum / s->sides;
}

/* What the optimality conditions leave at the iterate, for a barrier parameter; needs weigh(). */
static Residuals residuals(Workspace *s, double mu) {
  Residuals left = {0};
  double sum = 0.0, products = 0.0;
  for (int i = 0; i < s->rows; i++) {
    const double low = s->s_low[i] * s->z_low[i], up = s->s_up[i] * s->z_up[i];
    s->force[i] = s->z_up[i] - s->z_low[i] + s->y[i];
    left.primal = larger(left.primal, fabs(s->r_low[i]));
    left.primal = larger(left.primal, fabs(s->r_up[i]));
    left.primal = larger(left.primal, fabs(s->r_y[i]));
    left.product = larger(left.product, fabs(s->has_low[i] * (low - mu)));
    left.product = larger(left.product, fabs(s->has_up[i] * (up - mu)));
    left.multiplier = larger(left.multiplier, fabs(s->z_low[i]) + fabs(s->z_up[i]));
    left.multiplier = larger(left.multiplier, fabs(s->y[i]));
    products += low * s->has_low[i] + up * s->has_up[i];
    sum += fabs(s->z_low[i]) + fabs(s->z_up[i]) + fabs(s->y[i]);
  }
  for (int k = 0; k <= s->n; k++) {
    double g[NW];
    lagrangian_gradient(s, k, s->force, g);
    for (int i = 0; i < NU && k < s->n; i++)
      if (s->u_given[(size_t)k * NU + i] == 0.0) left.dual = larger(left.dual, fabs(g[i]));
    for (int i = 0; i < NX; i++) {
      if (k > 0 || s->x_given[i] == 0.0) left.dual = larger(left.dual, fabs(g[NU + i]));
      if (k == 0) continue;
      const double lambda = fabs(s->lambda[(size_t)k * NX + i]);
      left.multiplier = larger(left.multiplier, lambda);
      left.primal = larger(left.primal, fabs(s->gap[(size_t)(k - 1) * NX + i]));
      sum += lambda;
    }
  }
  left.mean_product = s->sides > 0.0 ? products / s->sides : 0.0;
  left.scale = fmax(100.0, sum / (s->n * NX + AT_LEAST_1(s->rows))) / 100.0;
  return left;
}

/* One number: the largest of the three, the gradient relative to the multipliers. */
static double error_of(const Residuals *left) {
  return larger(larger(left->dual / left->scale, left->primal), left->product / left->scale);
}
