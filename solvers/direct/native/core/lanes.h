/* Arithmetic on LANES numbers at once: one lane a stage, so that so many stages cost little more than
 * one. A V behaves as a double does; what the machine cannot do at once is done lane by lane.
 */

#include <math.h>
#include <stdint.h>

/* Nobody reads errno; without it a square root is one instruction. NaN and infinity stay. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("no-math-errno")
#endif
#if defined(__GNUC__) /* Vectors are passed between functions of this file alone. */
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

/* ONE_LANE: for processors without vectors, or with little memory. */
#if defined(__GNUC__) && !defined(ONE_LANE)
#define LANES 4
typedef double V __attribute__((vector_size(8 * LANES)));
typedef int64_t Truth __attribute__((vector_size(8 * LANES)));
#define LANE(a, l) ((a)[l])
#define ALL(c) ((V){(c), (c), (c), (c)})
/* a where a comparison holds, else b. */
#define CHOOSE(truth, a, b) ((V)(((truth) & (Truth)(a)) | (~(truth) & (Truth)(b))))
static inline int every(Truth truth) {
  int all = 1;
  for (int l = 0; l < LANES; l++) all &= truth[l] != 0;
  return all;
}
#else
#define LANES 1
typedef double V;
#define LANE(a, l) (*((void)(l), &(a)))
#define ALL(c) (c)
#define CHOOSE(truth, a, b) ((truth) ? (a) : (b))
typedef int Truth;
static inline int every(Truth truth) { return truth; }
#endif
/* 1.0 where a comparison holds, else 0.0. */
#define NUMBER(truth) CHOOSE(truth, ALL(1.0), ALL(0.0))

#define LANE_BY_LANE(name, call)                          \
  static inline V lanes_##name(V a) {                     \
    V result = a;                                         \
    for (int l = 0; l < LANES; l++) LANE(result, l) = call(LANE(a, l)); \
    return result;                                        \
  }
#define LANE_BY_LANE_2(name, call)                        \
  static inline V lanes_##name(V a, V b) {                \
    V result = a;                                         \
    for (int l = 0; l < LANES; l++) LANE(result, l) = call(LANE(a, l), LANE(b, l)); \
    return result;                                        \
  }

LANE_BY_LANE(exp, exp)
LANE_BY_LANE(log, log)
LANE_BY_LANE(sqrt, sqrt)
LANE_BY_LANE(tan, tan)
LANE_BY_LANE(asin, asin)
LANE_BY_LANE(acos, acos)
LANE_BY_LANE(atan, atan)
LANE_BY_LANE(sinh, sinh)
LANE_BY_LANE(cosh, cosh)
LANE_BY_LANE(tanh, tanh)
LANE_BY_LANE(asinh, asinh)
LANE_BY_LANE(acosh, acosh)
LANE_BY_LANE(atanh, atanh)
LANE_BY_LANE(erf, erf)
LANE_BY_LANE(log1p, log1p)
LANE_BY_LANE(expm1, expm1)
LANE_BY_LANE(floor, floor)
LANE_BY_LANE(ceil, ceil)
LANE_BY_LANE_2(pow, pow)
LANE_BY_LANE_2(fmod, fmod)
LANE_BY_LANE_2(remainder, remainder)
LANE_BY_LANE_2(copysign, copysign)
LANE_BY_LANE_2(atan2, atan2)
LANE_BY_LANE_2(hypot, hypot)

static inline V lanes_fabs(V a) { return CHOOSE(a < ALL(0.0), -a, a + ALL(0.0)); }
static inline V lanes_sign(V a) {
  return CHOOSE(a < ALL(0.0), ALL(-1.0), CHOOSE(a > ALL(0.0), ALL(1.0), a));
}
/* As in C: the other one where one is no number. */
static inline V lanes_fmin(V a, V b) { return CHOOSE((a < b) | (b != b), a, b); }
static inline V lanes_fmax(V a, V b) { return CHOOSE((a > b) | (b != b), a, b); }
static inline V lanes_if_else_zero(V a, V b) { return CHOOSE(a != ALL(0.0), b, ALL(0.0)); }

/* Sine and cosine: x = q pi/2 + r, with pi/2 in three parts, so that q times each of the first
 * two is exact, and polynomials in r. Beyond FAR_ANGLE, and for what is no number, as libm has it.
 * Source: the reduction and coefficients of fdlibm; within 1 unit in the last place.
 */
#define FAR_ANGLE 1e4
#define ROUNDS 6755399441055744.0 /* 1.5 * 2^52: added and subtracted it rounds to integers */

static inline V sine_of_rest(V r, V z) {
  const V p = ALL(-1.66666666666666324348e-01) +
              z * (ALL(8.33333333332248946124e-03) +
                   z * (ALL(-1.98412698298579493134e-04) +
                        z * (ALL(2.75573137070700676789e-06) +
                             z * (ALL(-2.50507602534068634195e-08) +
                                  z * ALL(1.58969099521155010221e-10)))));
  return r + r * z * p;
}

static inline V cosine_of_rest(V z) {
  const V p = ALL(4.16666666666666019037e-02) +
              z * (ALL(-1.38888888888741095749e-03) +
                   z * (ALL(2.48015872894767294178e-05) +
                        z * (ALL(-2.75573143513906633035e-07) +
                             z * (ALL(2.08757232129817482790e-09) +
                                  z * ALL(-1.13596475577881948265e-11)))));
  const V half = z * ALL(0.5), most = ALL(1.0) - half;
  return most + ((ALL(1.0) - most) - half + z * z * p);
}

/* The sine of x plus `quarters` right angles, for x that are not far. */
static inline V shifted_sine(V x, double quarters) {
  const V q = (x * ALL(6.36619772367581382433e-01) + ALL(ROUNDS)) - ALL(ROUNDS);
  const V r = ((x - q * ALL(1.57079632673412561417e+00)) - q * ALL(6.07710050630396597660e-11)) -
              q * ALL(2.02226624879595063154e-21);
  const V z = r * r, n = q + ALL(quarters);
  /* n modulo 4, as -2, -1, 0, 1 or 2 */
  const V m = n - ALL(4.0) * ((n * ALL(0.25) + ALL(ROUNDS)) - ALL(ROUNDS));
  const V sine = sine_of_rest(r, z), cosine = cosine_of_rest(z);
  const V even = CHOOSE(m == ALL(0.0), sine, -sine);
  const V odd = CHOOSE(m > ALL(0.0), cosine, -cosine);
  return CHOOSE((m == ALL(1.0)) | (m == ALL(-1.0)), odd, even);
}

#define SHIFTED_SINE(name, quarters)                                        \
  static inline V lanes_##name(V x) {                                       \
    if (every((x < ALL(FAR_ANGLE)) & (x > ALL(-FAR_ANGLE))))                \
      return shifted_sine(x, quarters);                                     \
    V result = x;                                                           \
    for (int l = 0; l < LANES; l++) LANE(result, l) = name(LANE(x, l));     \
    return result;                                                          \
  }
SHIFTED_SINE(sin, 0.0)
SHIFTED_SINE(cos, 1.0)
