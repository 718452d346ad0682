/* Feeds recorded measurements to the loop, and compares its inputs with the recorded ones.
 *
 *   example [largest difference that is accepted]
 */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "export.h"
#include "export_recorded.h"

static _Alignas(EXPORT_ALIGNMENT) unsigned char workspace[EXPORT_WORKSPACE_BYTES];

int main(int count, char **words) {
  const double accepted = count > 1 ? atof(words[1]) : 1e-9;
  double worst = 0.0;
  if (export_init(workspace, sizeof workspace) != EXPORT_SOLVED) return 2;
  if (export_reset(workspace, recorded_acting) != EXPORT_SOLVED) return 2;
  for (int k = 0; k < RECORDED_STEPS; k++) {
    const double *row = recorded[k], *x = row + 1, *p = x + EXPORT_NX, *wanted = p + EXPORT_NP;
    double u[EXPORT_NU];
    const export_status status = export_feedback(workspace, row[0], x, p, u);
    if (status != EXPORT_SOLVED) {
      printf("step %d: return code %d\n", k, (int)status);
      return 1;
    }
    for (int i = 0; i < EXPORT_NU; i++) {
      const double difference = fabs(u[i] - wanted[i]) / (1.0 + fabs(wanted[i]));
      if (!(difference <= worst)) worst = difference;
      if (!(difference <= accepted)) {
        printf("step %d: input %d is %.17g, recorded was %.17g\n", k, i, u[i], wanted[i]);
        return 1;
      }
    }
  }
  printf("%d steps, largest difference %.3g\n", RECORDED_STEPS, worst);
  return 0;
}
