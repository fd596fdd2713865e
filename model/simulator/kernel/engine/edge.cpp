// What the laws see of an edge.
struct Between { V d[3], w[3], square; };

INLINE Between between(const V me[8], const V other[8]) {
  Between b;
  b.square = splat(0);
  for (int k = 0; k < 3; ++k) {
    b.d[k] = other[k] - me[k];
    b.w[k] = other[3 + k] - me[3 + k];
    b.square += b.d[k] * b.d[k];
  }
  return b;
}

INLINE V along(const V a[3], const V b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

struct Edge : Between { V length, inverse, rate; };

// An edge without a direction pulls nowhere; a slot that only fills its slice up is one, from a point to itself.
// It is taken to be at rest, where every law is finite.
INLINE Edge edge(const Between &b, V rest) {
  Edge e;
  (Between &)e = b;
  M directed = b.square > SHORTEST_SQUARED;
#if SINGLE && defined(__AVX__) && !defined(__clang__) && (LANES == 8 || defined(__AVX512F__))
#if LANES == 16
  V guess = __builtin_ia32_rsqrt14ps512_mask(b.square, splat(0), -1);
#elif defined(__AVX512VL__)
  V guess = __builtin_ia32_rsqrt14ps256_mask(b.square, splat(0), -1);
#else
  V guess = __builtin_ia32_rsqrtps256(b.square);
#endif
  guess = guess * (R(1.5) - R(0.5) * b.square * guess * guess);
  e.inverse = directed ? guess : splat(0);
  e.length = directed ? b.square * guess : rest;
#else
  e.length = directed ? root(b.square) : rest;
  e.inverse = directed ? 1 / e.length : splat(0);
#endif
  e.rate = along(b.w, b.d) * e.inverse;
  return e;
}
