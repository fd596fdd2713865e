// The exponential function and the hyperbolic tangent of whole vectors.
//
// The C library's take one number at a time: a law that called one of them for each spring took ten times as long as
// others. Both begin with x = n ln 2 + r, |r| <= ln 2 / 2, and the Taylor polynomial of exp(r) - 1 (Cody and Waite,
// 1980, Software manual for the elementary functions), and are right to a few units in the last place.
#if SINGLE
enum { MANTISSA = 23, BIAS = 127 };
static const R ROUNDER = 12582912.0f, LOWEST = -104.0f, HIGHEST = 89.0f;
static const R LN2_HIGH = 0.693359375f, LN2_LOW = -2.12194440e-4f;
static const R TAYLOR[] = {1.0f / 2, 1.0f / 6, 1.0f / 24, 1.0f / 120, 1.0f / 720, 1.0f / 5040};
#else
enum { MANTISSA = 52, BIAS = 1023 };
static const R ROUNDER = 6755399441055744.0, LOWEST = -746.0, HIGHEST = 710.0;
static const R LN2_HIGH = 0.693147180369123816490, LN2_LOW = 1.90821492927058770002e-10;
static const R TAYLOR[] = {1.0 / 2, 1.0 / 6, 1.0 / 24, 1.0 / 120, 1.0 / 720, 1.0 / 5040, 1.0 / 40320, 1.0 / 362880,
                           1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800};
#endif
// Twice from where on a hyperbolic tangent is one.
static const R FLAT = 44;

// exp(x) - 1 = 2^n (1 + p) - 1: n, and p which is returned. p is NaN where x is.
INLINE V reduced(V x, M &n) {
  V shifted = x * splat(R(1.4426950408889634)) + splat(ROUNDER);
  n = (M)shifted - (M)splat(ROUNDER);
  V whole = shifted - splat(ROUNDER), r = (x - whole * splat(LN2_HIGH)) - whole * splat(LN2_LOW);
  V sum = splat(0);
  for (int i = sizeof(TAYLOR) / sizeof(R) - 1; i >= 0; --i) sum = (sum + splat(TAYLOR[i])) * r;
  return sum * r + r;
}

INLINE V power_of_two(M n) { return (V)((n + N(BIAS)) << N(MANTISSA)); }

INLINE V exponential(V x) {
  V bounded = x < LOWEST ? splat(LOWEST) : x;
  bounded = bounded > HIGHEST ? splat(HIGHEST) : bounded;
  M n;
  V p = reduced(bounded, n);
  // in two steps: 2^n alone may be too large or too small for a number that exp(x) is not
  M half = n >> N(1);
  return (p + splat(1)) * power_of_two(half) * power_of_two(n - half);
}

INLINE V tangent(V x) {
  V twice = splat(2) * magnitude(x);
  twice = twice > FLAT ? splat(FLAT) : twice;
  M n;
  V p = reduced(twice, n), scale = power_of_two(n);
  V t = scale * p + (scale - splat(1)), size = t / (t + splat(2));
  return x < 0 ? -size : size;
}
