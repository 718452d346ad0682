/* The memory of a control loop, and what is wrong with the arguments of a call.
 *
 * The block of a workspace is a Loop and behind it the block of the solver. What is generated
 * before this file: sizes, and how states, inputs and parameters of the user become those of the
 * solver (see problem_tables.py).
 */

#define LOOP_BYTES ((sizeof(Loop) + 63) / 64 * 64)
/* A plan whose state is further from the measured one, in sizes, is no start for the next. */
#define FAR_FROM_PLAN 100.0
/* A first trajectory explodes where its second half exceeds the first by this factor. */
#define EXPLODES 100.0
/* In that states below this share of the largest one count more. */
#define SMALL_SHARE 0.01
/* An answer beyond these is none, whatever the solver says of it. */
#define MOST_GRADIENT 1e-4
#define MOST_VIOLATION 1e-6
/* Instants that differ by this share of an interval are the same. */
#define SAME_STEP 1e-6

typedef struct {
  uint64_t magic; /* of this problem and version */
  int has_plan, has_input, is_pending, misses;
  double input[AT_LEAST_1(INPUTS)];                             /* the last one */
  double pending[AT_LEAST_1(DELAY_STEPS)][AT_LEAST_1(INPUTS)];  /* oldest first */
  double start[NX], user_start[USER_NX], parameters[AT_LEAST_1(USER_NP)];
  export_report report;
} Loop;

static Workspace *solver_of(const Loop *loop) {
  return (Workspace *)(void *)((char *)(uintptr_t)loop + LOOP_BYTES);
}

static int all_finite(const double *numbers, int count) {
  for (int i = 0; i < count; i++)
    if (!isfinite(numbers[i])) return 0;
  return 1;
}

/* result = constants + sum of weights times numbers. */
static void affine(const double *constants, int rows, const Term *terms, int count,
                   const double *numbers, double *result) {
  for (int i = 0; i < rows; i++) result[i] = constants[i];
  for (int i = 0; i < count; i++) result[terms[i].row] += terms[i].weight * numbers[terms[i].column];
}

/* What is wrong with a workspace; SOLVED: nothing. */
static export_status workspace_error(const void *workspace) {
  if (!workspace) return EXPORT_NULL;
  if ((uintptr_t)workspace % EXPORT_ALIGNMENT != 0) return EXPORT_MISALIGNED;
  return ((const Loop *)workspace)->magic == MAGIC ? EXPORT_SOLVED : EXPORT_FOREIGN_WORKSPACE;
}

/* What is wrong with the arguments of a solve. */
static export_status argument_error(const void *workspace, double t, const double *x,
                                    const double *parameters) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (!x || (!parameters && USER_NP > 0)) return EXPORT_NULL;
  if (!isfinite(t)) return EXPORT_BAD_TIME;
  if (!all_finite(x, USER_NX)) return EXPORT_BAD_MEASUREMENT;
  return all_finite(parameters, USER_NP) ? EXPORT_SOLVED : EXPORT_BAD_PARAMETER;
}

size_t export_workspace_bytes(void) { return LOOP_BYTES + export_core_bytes(INTERVALS); }

export_status export_init(void *workspace, size_t bytes) {
  if (!workspace) return EXPORT_NULL;
  if ((uintptr_t)workspace % EXPORT_ALIGNMENT != 0) return EXPORT_MISALIGNED;
  if (bytes < export_workspace_bytes()) return EXPORT_SMALL_WORKSPACE;
  Loop *loop = workspace;
  memset(loop, 0, LOOP_BYTES);
  export_core_set_up((char *)workspace + LOOP_BYTES, INTERVALS);
  Workspace *s = solver_of(loop);
  memcpy(s->sizes, state_sizes, sizeof state_sizes);
  memcpy(s->x_given, start_given, sizeof start_given);
  for (int k = 0; k < INTERVALS; k++)
    memcpy(s->u_given + (size_t)k * NU, control_given, sizeof(double) * NU);
  memcpy(s->low, lower_bounds, sizeof(double) * (size_t)s->rows);
  memcpy(s->up, upper_bounds, sizeof(double) * (size_t)s->rows);
  export_core_read_bounds((char *)s);
  loop->magic = MAGIC;
  return EXPORT_SOLVED;
}

export_status export_reset(void *workspace, const double *acting) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (acting && !all_finite(acting, INPUTS)) return EXPORT_BAD_INPUT;
  Loop *loop = workspace;
  memset(loop, 0, LOOP_BYTES);
  loop->magic = MAGIC;
  if (!acting || DELAY_STEPS == 0) return EXPORT_SOLVED;
  loop->has_input = 1;
  memcpy(loop->input, acting, sizeof(double) * INPUTS);
  for (int k = 0; k < DELAY_STEPS; k++)
    memcpy(loop->pending[k], acting, sizeof(double) * INPUTS);
  loop->is_pending = DELAY_STEPS;
  return EXPORT_SOLVED;
}

void export_declared(double *x, double *parameters) {
  if (x) memcpy(x, declared_start, sizeof(double) * USER_NX);
  if (parameters) memcpy(parameters, declared_parameters, sizeof(double) * USER_NP);
}

