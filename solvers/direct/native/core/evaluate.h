/* Values and derivatives of all nodes, by the generated functions, LANES stages at once. */

/* Copy the entries of node k that may have a bound. */
static void copy_bounded(const Workspace *s, int k, const double *x, const double *u, double *v) {
  for (int b = 0; b < NB; b++) {
    const int i = bounded[b];
    v[b] = i >= NU ? x[(size_t)k * NX + i - NU] : k < s->n ? u[(size_t)k * NU + i] : 0.0;
  }
}

/* Put numbers of a node into a lane, from entry `at` on; return the entry after them. */
static int put(V *in, int at, int lane, const double *numbers, int count) {
  for (int i = 0; i < count; i++) LANE(in[at + i], lane) = numbers[i];
  return at + count;
}

/* Get numbers of a node out of a lane, from entry `at` on; return the entry after them. */
static int get(const V *out, int at, int lane, double *numbers, int count) {
  for (int i = 0; i < count; i++) numbers[i] = LANE(out[at + i], lane);
  return at + count;
}

/* Cost, gaps and constrained quantities at (x, u); return the cost. */
static double evaluate_values(Workspace *s, const double *x, const double *u, double *gap,
                              double *v) {
  double cost = 0.0, l;
  V *in = s->in, *out = s->out;
  s->values++;
  for (int first = 0; first < s->n; first += LANES) {
    for (int lane = 0; lane < LANES; lane++) {
      const int k = first + lane < s->n ? first + lane : s->n - 1;
      int at = put(in, 0, lane, x + (size_t)k * NX, NX);
      at = put(in, at, lane, u + (size_t)k * NU, NU);
      put(in, at, lane, s->data + (size_t)k * ND, ND);
    }
    stage_value(in, out);
    for (int lane = 0; lane < LANES && first + lane < s->n; lane++) {
      const int k = first + lane;
      double *ahead = gap + (size_t)k * NX, *rows = v + rows_begin(k);
      int at = get(out, 0, lane, ahead, NX);
      at = get(out, at, lane, &l, 1);
      get(out, at, lane, rows + NB, NC);
      cost += l;
      copy_bounded(s, k, x, u, rows);
      for (int i = 0; i < NX; i++) ahead[i] -= x[(size_t)(k + 1) * NX + i];
    }
  }
  if (NI > 0) {
    for (int i = 0; i < NX; i++) in[i] = ALL(x[i]);
    for (int i = 0; i < ND; i++) in[NX + i] = ALL(s->data[i]);
    start_value(in, out);
    get(out, 0, 0, v + NB + NC, NI);
  }
  for (int i = 0; i < NX; i++) in[i] = ALL(x[(size_t)s->n * NX + i]);
  for (int i = 0; i < ND; i++) in[NX + i] = ALL(s->data[(size_t)s->n * ND + i]);
  end_value(in, out);
  copy_bounded(s, s->n, x, u, v + rows_begin(s->n));
  get(out, get(out, 0, 0, &l, 1), 0, v + rows_begin(s->n) + NB, NE);
  return cost + l;
}

/* Multipliers of the rows of node k, (count). */
static void row_multipliers(const Workspace *s, int first, int count, double *y) {
  for (int r = 0; r < count; r++)
    y[r] = s->y[first + r] + s->z_up[first + r] - s->z_low[first + r];
}

/* The stages of evaluate_at_iterate(). */
static void evaluate_stages(Workspace *s, int second) {
  double y[AT_LEAST_1(NC)], l;
  V *in = s->in, *out = s->out;
  for (int first = 0; first < s->n; first += LANES) {
    for (int lane = 0; lane < LANES; lane++) {
      const int k = first + lane < s->n ? first + lane : s->n - 1;
      row_multipliers(s, rows_begin(k) + NB, NC, y);
      int at = put(in, 0, lane, s->x + (size_t)k * NX, NX);
      at = put(in, at, lane, s->u + (size_t)k * NU, NU);
      at = put(in, at, lane, s->data + (size_t)k * ND, ND);
      at = put(in, at, lane, s->lambda + (size_t)(k + 1) * NX, NX);
      put(in, at, lane, y, NC);
    }
    if (second)
      stage_full(in, out);
    else
      stage_slope(in, out);
    for (int lane = 0; lane < LANES && first + lane < s->n; lane++) {
      const int k = first + lane;
      double *ahead = s->gap + (size_t)k * NX, *rows = s->v + rows_begin(k);
      int at = get(out, 0, lane, ahead, NX);
      at = get(out, at, lane, &l, 1);
      at = get(out, at, lane, rows + NB, NC);
      at = get(out, at, lane, s->slope + (size_t)k * NX * NW, NX * NW);
      at = get(out, at, lane, s->gradient + (size_t)k * NW, NW);
      at = get(out, at, lane, slopes_of_rows(s, k), NC * NW);
      if (second) get(out, at, lane, s->hessian + (size_t)k * NW * NW, NW * NW);
      s->cost += l;
      copy_bounded(s, k, s->x, s->u, rows);
      for (int i = 0; i < NX; i++) ahead[i] -= s->x[(size_t)(k + 1) * NX + i];
    }
  }
}

/* The rows of the start of evaluate_at_iterate(). */
static void evaluate_start(Workspace *s, int second) {
  double y[AT_LEAST_1(NI)];
  V *in = s->in, *out = s->out;
  row_multipliers(s, NB + NC, NI, y);
  for (int i = 0; i < NX; i++) in[i] = ALL(s->x[i]);
  for (int i = 0; i < ND; i++) in[NX + i] = ALL(s->data[i]);
  for (int i = 0; i < NI; i++) in[NX + ND + i] = ALL(y[i]);
  start_full(in, out);
  int at = get(out, 0, 0, s->v + NB + NC, NI);
  at = get(out, at, 0, slopes_of_rows(s, 0) + NC * NW, NI * NW);
  for (int i = 0; i < NW * NW && second; i++) s->hessian[i] += LANE(out[at + i], 0);
}

/* The last node of evaluate_at_iterate(). */
static void evaluate_end(Workspace *s) {
  double y[AT_LEAST_1(NE)], l;
  V *in = s->in, *out = s->out;
  const size_t n = (size_t)s->n;
  const int rows = rows_begin(s->n);
  row_multipliers(s, rows + NB, NE, y);
  for (int i = 0; i < NX; i++) in[i] = ALL(s->x[n * NX + i]);
  for (int i = 0; i < ND; i++) in[NX + i] = ALL(s->data[n * ND + i]);
  for (int i = 0; i < NE; i++) in[NX + ND + i] = ALL(y[i]);
  end_full(in, out);
  copy_bounded(s, s->n, s->x, s->u, s->v + rows);
  int at = get(out, 0, 0, &l, 1);
  at = get(out, at, 0, s->v + rows + NB, NE);
  at = get(out, at, 0, s->gradient + n * NW, NW);
  at = get(out, at, 0, slopes_of_rows(s, s->n), NE * NW);
  get(out, at, 0, s->hessian + n * NW * NW, NW * NW);
  s->cost += l;
}

/* Everything at the iterate and its multipliers, with first or also with second derivatives. */
static void evaluate_at_iterate(Workspace *s, int second) {
  s->has_hessian = second;
  s->evaluations++;
  s->cost = 0.0;
  evaluate_stages(s, second);
  if (NI > 0) evaluate_start(s, second);
  evaluate_end(s);
}
