/* The program frozen at an iterate: dynamics and rows linear there, the cost quadratic, with the
 * Hessian of the Lagrangian,
 *
 *   gap = gap0 + F_w dw - dx',   v = v0 + c_w dw,   gradient = gradient0 + H dw.
 *
 * Nothing is evaluated any more, so that a solve takes factorisations alone. From an optimum for one
 * start its answer for another one differs from that of the program itself by second-order terms.
 */

/* What of the iterate is kept where the program is frozen: pairs of arrays with their lengths. */
#define ITERATE(s)                                                                          \
  {{s->x + NX, s->x_frozen + NX, (size_t)s->n * NX},                                        \
   {s->u, s->u_frozen, (size_t)s->n * NU},                                                  \
   {s->lambda, s->lambda_frozen, ((size_t)s->n + 1) * NX},                                  \
   {s->s_low, s->s_low_frozen, (size_t)s->rows},                                            \
   {s->z_low, s->z_low_frozen, (size_t)s->rows},                                            \
   {s->s_up, s->s_up_frozen, (size_t)s->rows},                                              \
   {s->z_up, s->z_up_frozen, (size_t)s->rows},                                              \
   {s->y, s->y_frozen, (size_t)s->rows}}

typedef struct {
  double *own, *frozen;
  size_t count;
} Kept;

/* Freeze the program at the iterate; needs evaluate_at_iterate() with second derivatives. */
static void freeze(Workspace *s) {
  const Kept kept[] = ITERATE(s);
  for (size_t i = 0; i < sizeof kept / sizeof *kept; i++)
    memcpy(kept[i].frozen, kept[i].own, sizeof(double) * kept[i].count);
  memcpy(s->x_frozen, s->x, sizeof(double) * NX);
  memcpy(s->gap_frozen, s->gap, sizeof(double) * (size_t)s->n * NX);
  memcpy(s->v_frozen, s->v, sizeof(double) * (size_t)s->rows);
  memcpy(s->gradient_frozen, s->gradient, sizeof(double) * ((size_t)s->n + 1) * NW);
  s->cost_frozen = s->cost;
}

/* Go back to where the program is frozen; the start stays. */
static void go_back(Workspace *s) {
  const Kept kept[] = ITERATE(s);
  for (size_t i = 0; i < sizeof kept / sizeof *kept; i++)
    memcpy(kept[i].own, kept[i].frozen, sizeof(double) * kept[i].count);
}

/* How far node k is from where the program is frozen, (NW). */
static void from_frozen(const Workspace *s, int k, const double *x, const double *u, double *dw) {
  const size_t n = (size_t)k;
  for (int i = 0; i < NU; i++) dw[i] = k < s->n ? u[n * NU + i] - s->u_frozen[n * NU + i] : 0.0;
  for (int i = 0; i < NX; i++) dw[NU + i] = x[n * NX + i] - s->x_frozen[n * NX + i];
}

/* Cost, gaps and constrained quantities of the frozen program at (x, u), and its gradient where
 * there is a place for it; return the cost. */
static double evaluate_frozen(const Workspace *s, const double *x, const double *u, double *gap,
                              double *v, double *gradient) {
  double cost = s->cost_frozen;
  for (int k = 0; k <= s->n; k++) {
    const double *g = s->gradient_frozen + (size_t)k * NW, *c_slope = slopes_of_rows(s, k);
    const double *H = s->hessian + (size_t)k * NW * NW, *F = s->slope + (size_t)k * NX * NW;
    double dw[NW], *rows = v + rows_begin(k);
    from_frozen(s, k, x, u, dw);
    for (int i = 0; i < NW; i++) {
      double bent = 0.0;
      for (int j = 0; j < NW; j++) bent += H[i * NW + j] * dw[j];
      cost += dw[i] * (g[i] + 0.5 * bent);
      if (gradient) gradient[(size_t)k * NW + i] = g[i] + bent;
    }
    copy_bounded(s, k, x, u, rows);
    for (int r = 0; r < rows_of(s, k); r++) {
      double sum = s->v_frozen[rows_begin(k) + NB + r];
      for (int i = 0; i < NW; i++) sum += c_slope[(size_t)r * NW + i] * dw[i];
      rows[NB + r] = sum;
    }
    if (k == s->n) break;
    for (int i = 0; i < NX; i++) {
      const size_t at = (size_t)k * NX + i, next = at + NX;
      double sum = s->gap_frozen[at] - (x[next] - s->x_frozen[next]);
      for (int j = 0; j < NW; j++) sum += F[i * NW + j] * dw[j];
      gap[at] = sum;
    }
  }
  return cost;
}

/* As evaluate_values() and evaluate_at_iterate(), of the frozen program where it is that. */
static double values_of_program(Workspace *s, const double *x, const double *u, double *gap,
                                double *v) {
  if (!s->is_frozen) return evaluate_values(s, x, u, gap, v);
  return evaluate_frozen(s, x, u, gap, v, NULL);
}

static void evaluate_program(Workspace *s, int second) {
  if (s->is_frozen)
    s->cost = evaluate_frozen(s, s->x, s->u, s->gap, s->v, s->gradient);
  else
    evaluate_at_iterate(s, second);
}
