/* Many solves of one problem, one after the other, each with a start, data and a first iterate of its
 * own. Every thread calls this with a block of its own; nothing that one solve leaves there counts
 * for the next, so that answers do not depend on who computes them. */

/* Numbers of native_report(). */
#define REPORTED 13

typedef struct {
  /* First iterates, with the start in x_0, and then answers: one solve after the other, nodes
   * [n + 1][NX], [n][NU], [n + 1][NX]. */
  double *x, *u, *lambda;
  const double *data;   /* of the nodes, [n + 1][ND]: of every solve, or one for all */
  const int *own_data;  /* one number: whether every solve has its own */
  const int *has_states; /* of every solve: whether x is a first iterate, or the controls tell it */
  const int *warm;      /* of every solve: whether lambda is a guess of value */
  double *made;         /* of every solve, written at its end: its report, its ending, its account */
  const volatile int *stop; /* not 0: end as soon as possible */
} Batch;

/* What is written of a solve: a report, the ending, by how much half a step moves, still controls. */
#define MADE (REPORTED + 3)

static const double *data_of(const Workspace *s, const Batch *b, int i) {
  return b->data + (*b->own_data ? (size_t)i * ((size_t)s->n + 1) * ND : 0);
}

/* Integrate the controls of the solves first, ..., end - 1 that have no states: one lane a solve. */
void native_roll_out(char *block, const Batch *b, int first, int end) {
  Workspace *s = (Workspace *)block;
  const size_t states = ((size_t)s->n + 1) * NX, controls = (size_t)s->n * NU;
  for (int i = first; i < end; i += LANES)
    for (int k = 0; k < s->n; k++) {
      for (int lane = 0; lane < LANES; lane++) {
        const int j = i + lane < end ? i + lane : end - 1;
        int at = put(s->in, 0, lane, b->x + (size_t)j * states + (size_t)k * NX, NX);
        at = put(s->in, at, lane, b->u + (size_t)j * controls + (size_t)k * NU, NU);
        put(s->in, at, lane, data_of(s, b, j) + (size_t)k * ND, ND);
      }
      stage_value(s->in, s->out);
      for (int lane = 0; lane < LANES && i + lane < end; lane++)
        if (!b->has_states[i + lane])
          get(s->out, 0, lane, b->x + (size_t)(i + lane) * states + (size_t)(k + 1) * NX, NX);
    }
}

/* Solve one of them; what does not end as solved leaves its first iterate where it was. */
static void solve_one(char *block, const Batch *b, int i, const Options *options) {
  Workspace *s = (Workspace *)block;
  const size_t states = ((size_t)s->n + 1) * NX, controls = (size_t)s->n * NU;
  double *x = b->x + (size_t)i * states, *u = b->u + (size_t)i * controls;
  double *lambda = b->lambda + (size_t)i * states, *made = b->made + (size_t)i * MADE;
  memcpy(s->x, x, sizeof(double) * states);
  memcpy(s->u, u, sizeof(double) * controls);
  memcpy(s->lambda, lambda, sizeof(double) * states);
  memcpy(s->data, data_of(s, b, i), sizeof(double) * ((size_t)s->n + 1) * ND);
  native_begin(block);
  int ending = native_solve(block, &options[b->warm[i]], 1);
  while (ending == PAUSED && !*b->stop) ending = native_solve(block, &options[b->warm[i]], 0);
  native_report(block, made);
  made[REPORTED] = ending;
  if (ending != SOLVED) return;
  Account account;
  native_account(block, &account);
  made[REPORTED + 1] = account.moved;
  made[REPORTED + 2] = account.unmoved;
  memcpy(x, s->x, sizeof(double) * states);
  memcpy(u, s->u, sizeof(double) * controls);
  memcpy(lambda, s->lambda, sizeof(double) * states);
}

/* Solve first, ..., end - 1, unless it is to stop; options: of a cold start, and of a warm one. */
void native_solve_many(char *block, const Batch *b, const Options *options, int first, int end) {
  for (int i = first; i < end && !*b->stop; i++) solve_one(block, b, i, options);
}
