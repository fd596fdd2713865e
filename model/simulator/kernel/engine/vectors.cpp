// Vectors of numbers.
//
// Before this text come `typedef … R;` and `typedef … N;`, the number and the whole number of the same size, and
// the macros SINGLE, GROUND, SPRINGS, CONTROLLERS, STENCILS and LANES, how many numbers a vector has.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <sched.h>
#include <type_traits>
#include <vector>
#ifdef _OPENMP
#include <omp.h>
#else
static int omp_get_thread_num() { return 0; }
#endif

#define LAW inline __attribute__((always_inline))
#define INLINE static LAW

enum { W = LANES, ROW = 8, SHORT = 4 };
typedef R V __attribute__((vector_size(W * sizeof(R))));
typedef N M __attribute__((vector_size(W * sizeof(N))));
// The same anywhere in memory, whatever else it is taken for.
typedef R UV __attribute__((vector_size(W * sizeof(R)), aligned(sizeof(R)), may_alias));

INLINE V splat(R a) { V r; for (int i = 0; i < W; ++i) r[i] = a; return r; }
INLINE V load(const R *p) { return *(const UV *)p; }
INLINE void store(R *p, V v) { *(UV *)p = v; }
INLINE void accumulate(R *p, V v) { store(p, load(p) + v); }
INLINE V root(V a) { V r; for (int i = 0; i < W; ++i) r[i] = std::sqrt(a[i]); return r; }
INLINE V larger(V a, V b) { return a > b ? a : b; }
INLINE V smaller(V a, V b) { return a < b ? a : b; }
INLINE V magnitude(V a) { return a < 0 ? -a : a; }
#define EACH(name, call) \
  static __attribute__((noinline)) V name(V a) { V r; for (int i = 0; i < W; ++i) r[i] = call(a[i]); return r; }
EACH(logarithm, std::log)
EACH(sine, std::sin)
EACH(cosine, std::cos)
static __attribute__((noinline)) V power(V a, V b) {
  V r; for (int i = 0; i < W; ++i) r[i] = std::pow(a[i], b[i]); return r;
}
