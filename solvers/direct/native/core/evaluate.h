/* Values and derivatives of all nodes, by the generated functions. */

/* Call a generated function; `arg` and `res` are set by the caller. */
#define CALL(function) function(s->arg, s->res, s->iwork, s->work, 0)

/* Copy the entries of node k that may have a bound. */
static void copy_bounded(const Workspace *s, int k, const double *x, const double *u, double *v) {
  for (int b = 0; b < NB; b++) {
    const int i = bounded[b];
    v[b] = i >= NU ? x[(size_t)k * NX + i - NU] : k < s->n ? u[(size_t)k * NU + i] : 0.0;
  }
}

/* Cost, gaps and constrained quantities at (x, u); return the cost. */
static double evaluate_values(Workspace *s, const double *x, const double *u, double *gap,
                              double *v) {
  double cost = 0.0, l;
  s->values++;
  for (int k = 0; k < s->n; k++) {
    double *rows = v + rows_begin(k) + NB, *ahead = gap + (size_t)k * NX;
    copy_bounded(s, k, x, u, rows - NB);
    s->arg[0] = x + (size_t)k * NX;
    s->arg[1] = u + (size_t)k * NU;
    s->arg[2] = s->data + (size_t)k * ND;
    s->res[0] = ahead;
    s->res[1] = &l;
    s->res[2] = rows;
    CALL(stage_value);
    cost += l;
    for (int i = 0; i < NX; i++) ahead[i] -= x[(size_t)(k + 1) * NX + i];
  }
  if (NI > 0) {
    s->arg[0] = x;
    s->arg[1] = s->data;
    s->res[0] = v + NB + NC;
    CALL(start_value);
  }
  copy_bounded(s, s->n, x, u, v + rows_begin(s->n));
  s->arg[0] = x + (size_t)s->n * NX;
  s->arg[1] = s->data + (size_t)s->n * ND;
  s->res[0] = &l;
  s->res[1] = v + rows_begin(s->n) + NB;
  CALL(end_value);
  return cost + l;
}

/* The same at the iterate with first and second derivatives, for its multipliers. */
static void evaluate_all(Workspace *s) {
  double l, y[AT_LEAST_1(NC + NI + NE)];
  s->evaluations++;
  s->cost = 0.0;
  for (int k = 0; k <= s->n; k++) {
    const double *x = s->x + (size_t)k * NX, *d = s->data + (size_t)k * ND;
    const int first = rows_begin(k) + NB;
    double *rows = s->v + first, *c_slope = slopes_of_rows(s, k);
    double *gradient = s->gradient + (size_t)k * NW, *hessian = s->hessian + (size_t)k * NW * NW;
    copy_bounded(s, k, s->x, s->u, rows - NB);
    for (int r = 0; r < rows_of(s, k); r++)
      y[r] = s->y[first + r] + s->z_up[first + r] - s->z_low[first + r];
    if (k == s->n) {
      s->arg[0] = x, s->arg[1] = d, s->arg[2] = y;
      s->res[0] = &l, s->res[1] = rows, s->res[2] = gradient, s->res[3] = c_slope;
      s->res[4] = hessian;
      CALL(end_full);
    } else {
      double *gap = s->gap + (size_t)k * NX;
      s->arg[0] = x, s->arg[1] = s->u + (size_t)k * NU, s->arg[2] = d;
      s->arg[3] = s->lambda + (size_t)(k + 1) * NX, s->arg[4] = y;
      s->res[0] = gap, s->res[1] = &l, s->res[2] = rows;
      s->res[3] = s->slope + (size_t)k * NX * NW, s->res[4] = gradient, s->res[5] = c_slope;
      s->res[6] = hessian;
      CALL(stage_full);
      for (int i = 0; i < NX; i++) gap[i] -= x[NX + i];
      if (k == 0 && NI > 0) {
        double own[NW * NW];
        s->arg[0] = x, s->arg[1] = d, s->arg[2] = y + NC;
        s->res[0] = rows + NC, s->res[1] = c_slope + NC * NW, s->res[2] = own;
        CALL(start_full);
        for (int i = 0; i < NW * NW; i++) hessian[i] += own[i];
      }
    }
    s->cost += l;
  }
}
