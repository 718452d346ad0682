/* The Newton step of the condensed system, by a Riccati recursion.
 *
 * With H the Hessian of the Lagrangian, c_w the slopes of the rows, sigma their weights, A and B the
 * columns of F_w along x and u, and dx' the step of the next node,
 *
 *   minimise sum_k  1/2 dw'(H + shift E + c_w' sigma c_w) dw + rhs' dw,   dx' = A dx + B du + gap.
 *
 * The value of what follows node k is 1/2 dx'P dx + p'dx, its derivative the change of the costate:
 *
 *   Q  = H + shift E + c_w' sigma c_w + F_w' P' F_w        L D L' = Q_uu
 *   K  = -Q_uu^-1 Q_ux,       P = Q_xx + Q_xu K,           closed = A + B K
 *   q  = rhs + F_w'(p' + P' gap)
 *   kappa = -Q_uu^-1 q_u,     p = q_x + K' q_u
 *
 * and forwards du = K dx + kappa, dx' = closed dx + B kappa + gap, dlambda = P dx + p. A given entry
 * of u has a zero row in K and kappa. What is free of x_0 minimises the value of node 0. All
 * pivots are positive if and only if the step minimises.
 */

/* A pivot below this part of the diagonal, or of the largest one, is no positive number. */
#define PIVOT 1e-14

/* Add weight times the outer product of a row with itself; zeros of the row cost nothing. */
static void add_outer(double Q[NW][NW], double weight, const double *row) {
  for (int i = 0; i < NW; i++) {
    const double a = weight * row[i];
    if (a == 0.0) continue;
    for (int j = 0; j < NW; j++) Q[i][j] += a * row[j];
  }
}

/* H + shift E + c_w' sigma c_w of node k. */
static void condensed_hessian(const Workspace *s, int k, double shift, double Q[NW][NW]) {
  const double *sigma = s->sigma + rows_begin(k), *c_slope = slopes_of_rows(s, k);
  memcpy(Q, s->hessian + (size_t)k * NW * NW, sizeof(double) * NW * NW);
  for (int i = 0; i < NW; i++) Q[i][i] += shift;
  for (int b = 0; b < NB; b++) Q[bounded[b]][bounded[b]] += sigma[b];
  for (int r = 0; r < rows_of(s, k); r++)
    if (sigma[NB + r] != 0.0) add_outer(Q, sigma[NB + r], c_slope + (size_t)r * NW);
}

/* Factorise what is free of x_0; return whether all pivots are positive. */
static int factorise_start(Workspace *s) {
  const double(*P)[NX] = (const double(*)[NX])s->P;
  double(*S)[NX] = (double(*)[NX])s->start_factor;
  double largest = 0.0;
  for (int i = 0; i < NX; i++)
    for (int j = 0; j < NX; j++) {
      const int given = s->x_given[i] != 0.0 || s->x_given[j] != 0.0;
      S[i][j] = given ? (double)(i == j) : P[i][j];
      if (!given && i == j && P[i][i] > largest) largest = P[i][i];
    }
  for (int p = 0; p < NX; p++) {
    const double d = S[p][p];
    if (!(d > (s->x_given[p] != 0.0 ? 0.0 : PIVOT * largest))) return 0;
    s->start_pivot[p] = 1.0 / d;
    for (int i = p + 1; i < NX; i++) {
      const double a = S[p][i] / d;
      for (int j = i; j < NX; j++) S[i][j] -= a * S[p][j];
    }
  }
  return 1;
}

/* Factorise with a shift of the Hessian; return whether all pivots are positive. */
static int factorise(Workspace *s, double shift) {
  double(*Q)[NW] = (double(*)[NW])s->Q, (*S)[NW] = (double(*)[NW])s->S;
  s->factorisations++;
  condensed_hessian(s, s->n, shift, Q);
  double(*P)[NX] = (double(*)[NX])(s->P + (size_t)s->n * NX * NX);
  for (int i = 0; i < NX; i++)
    for (int j = 0; j < NX; j++) P[i][j] = Q[NU + i][NU + j];
  for (int k = s->n - 1; k >= 0; k--) {
    const double(*F)[NW] = (const double(*)[NW])(s->slope + (size_t)k * NX * NW);
    double(*K)[NX] = (double(*)[NX])(s->K + (size_t)k * NU * NX);
    double *L = s->L + (size_t)k * NU * NU, *pivot = s->pivot + (size_t)k * NU;
    const double *given = s->u_given + (size_t)k * NU;
    condensed_hessian(s, k, shift, Q);
    for (int i = 0; i < NX; i++) {
      for (int j = 0; j < NW; j++) S[i][j] = 0.0;
      for (int a = 0; a < NX; a++) {
        const double c = P[i][a];
        for (int j = 0; j < NW; j++) S[i][j] += c * F[a][j];
      }
    }
    for (int i = 0; i < NW; i++)
      for (int a = 0; a < NX; a++) {
        const double c = F[a][i];
        for (int j = 0; j < NW; j++) Q[i][j] += c * S[a][j];
      }
    for (int p = 0; p < NU; p++) {
      if (given[p] == 0.0) continue;
      for (int j = 0; j < NW; j++) Q[p][j] = Q[j][p] = 0.0;
      Q[p][p] = 1.0;
    }
    double diagonal[AT_LEAST_1(NU)];
    for (int p = 0; p < NU; p++) diagonal[p] = fabs(Q[p][p]);
    for (int p = 0; p < NU; p++) {
      const double d = Q[p][p];
      if (!(d > PIVOT * diagonal[p])) return 0;
      pivot[p] = 1.0 / d;
      for (int i = p + 1; i < NW; i++) {
        const double a = Q[p][i] * pivot[p];
        if (i < NU) L[i * NU + p] = a;
        for (int j = i < NU ? i : NU; j < NW; j++) Q[i][j] -= a * Q[p][j];
      }
    }
    for (int p = NU - 1; p >= 0; p--)
      for (int j = 0; j < NX; j++) {
        double a = -Q[p][NU + j] * pivot[p];
        for (int i = p + 1; i < NU; i++) a -= L[i * NU + p] * K[i][j];
        K[p][j] = a;
      }
    double(*closed)[NX] = (double(*)[NX])(s->closed + (size_t)k * NX * NX);
    for (int i = 0; i < NX; i++) {
      for (int j = 0; j < NX; j++) closed[i][j] = F[i][NU + j];
      for (int p = 0; p < NU; p++)
        for (int j = 0; j < NX; j++) closed[i][j] += F[i][p] * K[p][j];
    }
    P = (double(*)[NX])(s->P + (size_t)k * NX * NX);
    for (int i = 0; i < NX; i++)
      for (int j = 0; j <= i; j++) {
        P[i][j] = P[j][i] = 0.5 * (Q[NU + i][NU + j] + Q[NU + j][NU + i]);
      }
  }
  return factorise_start(s);
}

/* Solve for a right-hand side, [n + 1][NW], and gaps (NULL: none): dx, du, dlambda. */
static void solve_system(Workspace *s, const double *rhs, const double *gap, double *dx,
                         double *du, double *dlambda) {
  for (int i = 0; i < NX; i++) s->p[(size_t)s->n * NX + i] = rhs[(size_t)s->n * NW + NU + i];
  for (int k = s->n - 1; k >= 0; k--) {
    const double(*F)[NW] = (const double(*)[NW])(s->slope + (size_t)k * NX * NW);
    const double(*K)[NX] = (const double(*)[NX])(s->K + (size_t)k * NU * NX);
    const double(*P)[NX] = (const double(*)[NX])(s->P + (size_t)(k + 1) * NX * NX);
    const double *L = s->L + (size_t)k * NU * NU, *pivot = s->pivot + (size_t)k * NU;
    const double *given = s->u_given + (size_t)k * NU;
    const double *after = s->p + (size_t)(k + 1) * NX;
    double *before = s->p + (size_t)k * NX, *kappa = s->kappa + (size_t)k * NU;
    double m[NX], q[NW];
    for (int i = 0; i < NX; i++) m[i] = after[i];
    if (gap)
      for (int j = 0; j < NX; j++) {
        const double c = gap[(size_t)k * NX + j];
        for (int i = 0; i < NX; i++) m[i] += P[j][i] * c;
      }
    for (int j = 0; j < NW; j++) q[j] = rhs[(size_t)k * NW + j];
    for (int i = 0; i < NX; i++)
      for (int j = 0; j < NW; j++) q[j] += m[i] * F[i][j];
    for (int p = 0; p < NU; p++)
      if (given[p] != 0.0) q[p] = 0.0;
    for (int i = 0; i < NX; i++) before[i] = q[NU + i];
    for (int p = 0; p < NU; p++)
      for (int i = 0; i < NX; i++) before[i] += K[p][i] * q[p];
    for (int p = 0; p < NU; p++) {
      for (int i = p + 1; i < NU; i++) q[i] -= L[i * NU + p] * q[p];
      kappa[p] = -q[p] * pivot[p];
    }
    for (int p = NU - 1; p >= 0; p--)
      for (int i = p + 1; i < NU; i++) kappa[p] -= L[i * NU + p] * kappa[i];
  }
  const double(*start)[NX] = (const double(*)[NX])s->start_factor;
  for (int p = 0; p < NX; p++) dx[p] = s->x_given[p] != 0.0 ? 0.0 : -s->p[p];
  for (int p = 0; p < NX; p++)
    for (int i = p + 1; i < NX; i++) dx[i] -= start[p][i] * s->start_pivot[p] * dx[p];
  for (int p = 0; p < NX; p++) dx[p] *= s->start_pivot[p];
  for (int p = NX - 1; p >= 0; p--)
    for (int i = p + 1; i < NX; i++)
      dx[p] -= start[p][i] * s->start_pivot[p] * dx[i];
  for (int k = 0; k <= s->n; k++) {
    const double *now = dx + (size_t)k * NX;
    const double(*P)[NX] = (const double(*)[NX])(s->P + (size_t)k * NX * NX);
    double *costate = dlambda + (size_t)k * NX;
    for (int i = 0; i < NX; i++) costate[i] = s->p[(size_t)k * NX + i];
    for (int j = 0; j < NX; j++)
      for (int i = 0; i < NX; i++) costate[i] += P[j][i] * now[j];
    if (k == s->n) break;
    const double(*F)[NW] = (const double(*)[NW])(s->slope + (size_t)k * NX * NW);
    const double(*K)[NX] = (const double(*)[NX])(s->K + (size_t)k * NU * NX);
    const double(*closed)[NX] = (const double(*)[NX])(s->closed + (size_t)k * NX * NX);
    const double *kappa = s->kappa + (size_t)k * NU;
    double *control = du + (size_t)k * NU, *next = dx + (size_t)(k + 1) * NX;
    for (int p = 0; p < NU; p++) {
      control[p] = kappa[p];
      for (int i = 0; i < NX; i++) control[p] += K[p][i] * now[i];
    }
    for (int i = 0; i < NX; i++) {
      next[i] = gap ? gap[(size_t)k * NX + i] : 0.0;
      for (int p = 0; p < NU; p++) next[i] += F[i][p] * kappa[p];
      for (int j = 0; j < NX; j++) next[i] += closed[i][j] * now[j];
    }
  }
}
