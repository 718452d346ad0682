/* What the answer of a solve is worth, beside the optimality conditions. */

typedef struct {
  double moved;   /* by half the integration step: the largest change of a state, relative */
  double node;    /* where */
  double unmoved; /* controls that are those of the first iterate all along */
} Account;

/* By how much half the integration step moves the end of an interval, relative to size + abs(x);
 * the largest, and its node; what is no number is larger than any. */
static double half_step_error(Workspace *s, double *node) {
  V *in = s->in, *out = s->out;
  double worst = 0.0;
  *node = 1.0;
  for (int first = 0; first < s->n; first += LANES) {
    for (int lane = 0; lane < LANES; lane++) {
      const int k = first + lane < s->n ? first + lane : s->n - 1;
      int at = put(in, 0, lane, s->x + (size_t)k * NX, NX);
      at = put(in, at, lane, s->u + (size_t)k * NU, NU);
      put(in, at, lane, s->data + (size_t)k * ND, ND);
    }
    stage_half(in, out);
    for (int lane = 0; lane < LANES && first + lane < s->n; lane++) {
      const double *ahead = s->x + (size_t)(first + lane + 1) * NX;
      for (int i = 0; i < NX; i++) {
        const double change = LANE(out[i], lane) - ahead[i];
        const double moved = fabs(change) / (s->sizes[i] + fabs(ahead[i]));
        s->half_step[(size_t)(first + lane) * NX + i] = change;
        if (moved <= worst || worst != worst) continue;
        worst = moved;
        *node = first + lane + 1;
      }
    }
  }
  return worst;
}

/* How many controls are those of the first iterate at all nodes. */
static double unmoved_controls(const Workspace *s) {
  int unmoved = 0;
  for (int i = 0; i < NU; i++) {
    int k = 0;
    for (; k < s->n; k++) {
      const double before = s->u_first[(size_t)k * NU + i], after = s->u[(size_t)k * NU + i];
      if (fabs(after - before) > UNCHANGED * (1.0 + fabs(before))) break;
    }
    unmoved += k == s->n;
  }
  return unmoved;
}

/* The costate at a given start is what balances it there: the gradient without a costate. */
static void costate_of_start(Workspace *s) {
  double g[NW];
  for (int i = 0; i < s->rows; i++) s->force[i] = s->z_up[i] - s->z_low[i] + s->y[i];
  lagrangian_gradient(s, 0, s->force, g);
  memcpy(s->lambda, g + NU, sizeof(double) * NX);
}
