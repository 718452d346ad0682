/* The memory of one problem: everything that a solve reads and writes, laid out in a block that the
 * caller owns. There is no other memory, and no static data that changes.
 *
 * What the generated part has to define before this file:
 *
 *   NX, NU, NW     states and controls of a node, and NW = NU + NX; a node is w = (u, x)
 *   NB             number of entries of w that may have a bound; bounded[NB]: which
 *   NC, NI, NE     rows of every stage, rows of the start alone, rows of the end
 *   ND             data of a node (times and parameters)
 *   NOTED          iterations of which something is noted; beyond, the last note is of the newest
 *   SAME_INSTANT   instants that differ by this share of the horizon are the same
 *   UNCHANGED      changes of a control below this, relative to 1 + abs(u), count as none
 *
 * and functions of arrays of lanes (see lanes.h), which take their arguments one after the other and
 * return their values so; x is (NX), u (NU), d (ND), lambda (NX), y as many as rows, and matrices
 * are stored row by row:
 *
 *   stage_value(x, u, d)                next state F, cost l, rows c
 *   stage_full(x, u, d, lambda, y)      F, l, c, F_w, l_w, c_w, (l + lambda'F + y'c)_ww
 *   stage_slope(x, u, d, lambda, y)     the same without the last
 *   start_value(x, d), start_full(x, d, y)   c   |   c, c_w, (y'c)_ww
 *   end_value(x, d), end_full(x, d, y)       l, c   |   l, c, l_w, c_w, (l + y'c)_ww
 *   stage_half(x, u, d)                 next state, with half the integration step
 */

#include <math.h>
#include <stddef.h>
#include <string.h>
#ifndef NO_CLOCK /* without one there is no limit of time */
#include <time.h>
#endif

#define AT_LEAST_1(n) ((n) > 0 ? (n) : 1)

/* Numbers that the generated functions take and return, at most. */
#define MOST_ROWS (NC + NI + NE)
#define MOST_IN (2 * NX + NU + ND + MOST_ROWS)
#define MOST_OUT (NX + 1 + MOST_ROWS + (NX + 1 + MOST_ROWS + NW) * NW)

/* Pairs that a filter remembers; beyond, the oldest is forgotten. */
#define FILTER 64

typedef struct {
  double tolerance;     /* of the optimality conditions */
  double barrier;       /* first barrier parameter */
  double max_iterations;
  double time_limit;    /* [s] */
  double pause;         /* after so long native_solve() returns PAUSED, to be called again [s] */
  double warm;          /* whether the costates are a guess of value */
  double monotone;      /* whether the barrier parameter only falls, from the beginning */
  double frozen;        /* whether to solve the program of frozen.h, from its own multipliers */
} Options;

typedef enum {
  SOLVED = 0,
  ITERATION_LIMIT = 1,
  NO_STEP = 2,
  NOT_FINITE = 3,
  TIME_LIMIT = 4,
  DIVERGED = 5,
  PAUSED = 6
} Ending;

/* What is noted of an iteration: the residuals before it, and the step. */
typedef struct {
  double cost, primal, dual, product, mu, shift, length;
} Note;

/* What the optimality conditions leave, largest entries. */
typedef struct {
  double dual;         /* gradient of the Lagrangian, among what is free */
  double primal;       /* gaps, rows, slacks */
  double product;      /* slack times multiplier, minus the barrier parameter */
  double mean_product; /* mean of slack times multiplier */
  double multiplier;   /* largest multiplier */
  double scale;        /* what the gradient is measured in: IPOPT's s_d */
} Residuals;

typedef struct {
  int n;    /* intervals N */
  int rows; /* length of all flat arrays over constrained quantities */

  /* Iterate: nodes one after the other. */
  double *x, *u, *lambda;
  /* Flat, one entry for each constrained quantity: slacks and multipliers of the lower and the
   * upper side, multiplier of an equation. */
  double *s_low, *z_low, *s_up, *z_up, *y;

  /* Data: of the nodes; bounds, and 1.0 where a quantity has that side or is an equation. */
  double *data, *low, *up, *has_low, *has_up, *is_equation;
  /* 1.0 where an entry of u, or of x_0, is given and not an unknown. */
  double *u_given, *x_given;
  double sides; /* number of slacks */
  double *sizes; /* of the states, (NX): what the accuracy of the integration is relative to */

  /* The plan that a warm start is read off from: its nodes [s], states, controls, costates. */
  double *plan_t, *plan_x, *plan_u, *plan_lambda;
  double *u_first;   /* controls of the first iterate */
  double *half_step; /* by how much half the integration step moves the ends of the intervals */

  /* Step. */
  double *dx, *du, *dlambda, *ds_low, *dz_low, *ds_up, *dz_up, *dy;
  /* A correction of the step (refinement). */
  double *ex, *eu, *elambda, *ey;
  /* Trial iterate. */
  double *x_trial, *u_trial, *gap_trial, *v_trial;

  /* Values and derivatives at the iterate. */
  double cost, cost_trial;
  double *gap;       /* F(w_k) - x_{k+1} */
  double *v;         /* constrained quantities */
  double *slope;     /* F_w, [n][NX][NW] */
  double *gradient;  /* of the cost l, [n + 1][NW] */
  double *hessian;   /* of the Lagrangian, [n + 1][NW][NW] */
  double *c_slope;   /* of the rows, one [NW] a row, in the order of the rows */

  /* Where the program is frozen, see frozen.h, and what was evaluated there. */
  int is_frozen;
  double cost_frozen, *x_frozen, *u_frozen, *gap_frozen, *v_frozen, *gradient_frozen;
  double *lambda_frozen, *s_low_frozen, *z_low_frozen, *s_up_frozen, *z_up_frozen, *y_frozen;

  /* Condensed system: weights and right-hand side. */
  double *r_low, *r_up, *r_y, *corr_low, *corr_up, *sigma, *force, *dv;
  double *rhs; /* [n + 1][NW] */

  /* Factor. */
  double *P, *K, *L, *closed; /* [n + 1][NX][NX], [n][NU][NX], [n][NU][NU], [n][NX][NX] */
  double *pivot;              /* [n][NU] */
  double *p, *kappa;          /* [n + 1][NX], [n][NU] */
  double *start_factor, *start_pivot; /* [NX][NX], [NX] */

  /* Scratch: of factorise(), and what goes into and comes out of the generated functions. */
  double *Q, *S; /* [NW][NW], [NX][NW] */
  V *in, *out;

  /* Course of the iteration. */
  Residuals left;
  double mu, shift, last_shift, length, largest_theta;
  int iteration, is_monotone, factorisations, evaluations, values;
  int has_hessian; /* whether it is that of the iterate */
  double best;     /* the smallest error so far */
  int since_best;  /* iterations without a smaller one */
  int filter_size;
  double filter_theta[FILTER], filter_phi[FILTER];
  double seconds; /* used so far */
  Note notes[NOTED];
} Workspace;

/* Where the constrained quantities of node k begin in the flat arrays. */
static int rows_begin(int k) { return k == 0 ? 0 : NI + k * (NB + NC); }

/* Rows (not bounds) of node k. */
static int rows_of(const Workspace *s, int k) { return k == s->n ? NE : k == 0 ? NC + NI : NC; }

/* Derivative of the first row of node k. */
static double *slopes_of_rows(const Workspace *s, int k) {
  return s->c_slope + (size_t)(k == 0 ? 0 : NI + k * NC) * NW;
}

/* Take `count` doubles, aligned to a cache line, from the block. */
static double *take(char **at, size_t count) {
  double *taken = (double *)*at;
  *at += (count * sizeof(double) + 63) / 64 * 64;
  return taken;
}

/* Lay the arrays out for n intervals; return the end. With `s` in front of the block. */
static char *lay_out(Workspace *s, char *at, int n) {
  const size_t m = (size_t)n + 1;
  s->n = n;
  s->rows = rows_begin(n) + NB + NE;
  double **states[] = {&s->x,  &s->lambda,  &s->dx,      &s->dlambda,
                       &s->ex, &s->elambda, &s->x_trial, &s->p,
                       &s->plan_x, &s->plan_lambda, &s->x_frozen, &s->gap_frozen,
                       &s->lambda_frozen};
  double **controls[] = {&s->u,     &s->du,      &s->eu,     &s->u_trial, &s->kappa,
                         &s->pivot, &s->u_given, &s->plan_u, &s->u_first, &s->u_frozen};
  double **flat[] = {&s->s_low,  &s->z_low,    &s->s_up,   &s->z_up,    &s->y,     &s->low,
                     &s->up,     &s->has_low,  &s->has_up, &s->is_equation, &s->ds_low, &s->dz_low,
                     &s->ds_up,  &s->dz_up,    &s->dy,     &s->ey,      &s->v,     &s->v_trial,
                     &s->r_low,  &s->r_up,     &s->r_y,    &s->corr_low, &s->corr_up, &s->sigma,
                     &s->force,  &s->dv,       &s->v_frozen, &s->s_low_frozen,
                     &s->z_low_frozen, &s->s_up_frozen, &s->z_up_frozen, &s->y_frozen};
  for (size_t i = 0; i < sizeof states / sizeof *states; i++) *states[i] = take(&at, m * NX);
  for (size_t i = 0; i < sizeof controls / sizeof *controls; i++)
    *controls[i] = take(&at, m * AT_LEAST_1(NU));
  for (size_t i = 0; i < sizeof flat / sizeof *flat; i++)
    *flat[i] = take(&at, (size_t)AT_LEAST_1(s->rows));
  s->x_given = take(&at, NX);
  s->sizes = take(&at, NX);
  s->plan_t = take(&at, m);
  s->data = take(&at, m * ND);
  s->gap = take(&at, m * NX);
  s->gap_trial = take(&at, m * NX);
  s->half_step = take(&at, m * NX);
  s->slope = take(&at, m * NX * NW);
  s->gradient = take(&at, m * NW);
  s->gradient_frozen = take(&at, m * NW);
  s->rhs = take(&at, m * NW);
  s->hessian = take(&at, m * NW * NW);
  s->c_slope = take(&at, ((size_t)NI + m * NC + NE + 1) * NW);
  s->P = take(&at, m * NX * NX);
  s->K = take(&at, m * AT_LEAST_1(NU) * NX);
  s->L = take(&at, m * AT_LEAST_1(NU) * AT_LEAST_1(NU));
  s->closed = take(&at, m * NX * NX);
  s->start_factor = take(&at, NX * NX);
  s->start_pivot = take(&at, NX);
  s->Q = take(&at, NW * NW);
  s->S = take(&at, NX * NW);
  s->in = (V *)take(&at, LANES * (size_t)MOST_IN);
  s->out = (V *)take(&at, LANES * (size_t)MOST_OUT);
  return at;
}
