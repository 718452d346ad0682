/* What is read of a workspace. */

export_status export_plan(const void *workspace, double *t, double *x, double *u) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  const Loop *loop = workspace;
  const Workspace *s = solver_of(loop);
  if (!loop->has_plan) return EXPORT_NO_PLAN;
  for (int k = 0; k <= INTERVALS; k++) {
    const double *own = s->plan_x + (size_t)k * NX;
    if (t) t[k] = s->plan_t[k];
    for (int i = 0; i < USER_NX && x; i++) x[k * USER_NX + i] = own[i] * user_scales[i];
    for (int i = 0; i < USER_NU && u && k < INTERVALS; i++) {
      const int from = control_from[i];
      const double value = from < FORM_NX ? own[from] : s->plan_u[k * NU + from - FORM_NX];
      u[k * USER_NU + i] = value * control_sizes[i];
    }
  }
  return EXPORT_SOLVED;
}

export_status export_constants(const void *workspace, double *values) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (!values) return EXPORT_NULL;
  const Loop *loop = workspace;
  if (!loop->has_plan) return EXPORT_NO_PLAN;
  for (int i = 0; i < COUNT(constants); i++)
    values[i] = solver_of(loop)->plan_x[constants[i].row] * constants[i].weight;
  return EXPORT_SOLVED;
}

export_status export_last_report(const void *workspace, export_report *report) {
  const export_status wrong = workspace_error(workspace);
  if (wrong != EXPORT_SOLVED) return wrong;
  if (!report) return EXPORT_NULL;
  *report = ((const Loop *)workspace)->report;
  return EXPORT_SOLVED;
}
