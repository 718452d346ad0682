/* The first iterate of a warm start: an earlier plan, moved to now and into the bounds. */

/* What a plan says at a share of the way from one of its rows to the next. */
static void between(const double *rows, int width, int left, double share, double *result) {
  const double *below = rows + (size_t)left * width, *above = below + width;
  for (int i = 0; i < width; i++) result[i] = below[i] + share * (above[i] - below[i]);
}

/* Read the plan off at the nodes of a horizon that begins at t0 [s]. Beyond its end states go on
 * along their last slope, controls and costates stay as they were. */
static void shift_plan(Workspace *s, double t0, double duration) {
  const double *t = s->plan_t;
  int left = 0, acting = 0;
  for (int k = 0; k <= s->n; k++) {
    const double now = t0 + s->data[(size_t)k * ND + 1] * duration;
    const double inside = fmin(fmax(now, t[0]), t[s->n]);
    while (left < s->n - 1 && t[left + 1] <= now) left++;
    const double width = t[left + 1] - t[left];
    between(s->plan_x, NX, left, (now - t[left]) / width, s->x + (size_t)k * NX);
    between(s->plan_lambda, NX, left, (inside - t[left]) / width, s->lambda + (size_t)k * NX);
    if (k == s->n) break;
    while (acting < s->n - 1 && t[acting + 1] <= now + SAME_INSTANT * duration) acting++;
    memcpy(s->u + (size_t)k * NU, s->plan_u + (size_t)acting * NU, sizeof(double) * NU);
  }
}

/* Move the iterate into its bounds; what is given stays as it is. */
static void clip_to_bounds(Workspace *s) {
  for (int k = 0; k <= s->n; k++)
    for (int b = 0; b < NB; b++) {
      const int i = rows_begin(k) + b, entry = bounded[b];
      if (entry < NU && k == s->n) continue;
      double *w = entry < NU ? s->u + (size_t)k * NU + entry : s->x + (size_t)k * NX + entry - NU;
      if (s->is_equation[i] != 0.0) *w = s->low[i];
      if (s->has_low[i] != 0.0 && *w < s->low[i]) *w = s->low[i];
      if (s->has_up[i] != 0.0 && *w > s->up[i]) *w = s->up[i];
    }
}
