// Vectors of eight numbers, and rows of eight numbers turned into vectors and back.
//
// Before this text come `typedef … R;` and `typedef … N;`, the number and the whole number of the same size, and
// the macros SINGLE, GROUND, SPRINGS, CONTROLLERS and STENCILS.
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

enum { W = 8, ROW = 8, SHORT = 4 };
typedef R V __attribute__((vector_size(W * sizeof(R))));
typedef N M __attribute__((vector_size(W * sizeof(N))));
typedef R H __attribute__((vector_size(SHORT * sizeof(R))));
// The same anywhere in memory, whatever else it is taken for.
typedef R UV __attribute__((vector_size(W * sizeof(R)), aligned(sizeof(R)), may_alias));
typedef R UH __attribute__((vector_size(SHORT * sizeof(R)), aligned(sizeof(R)), may_alias));

INLINE V splat(R a) { return V{a, a, a, a, a, a, a, a}; }
INLINE V load(const R *p) { return *(const UV *)p; }
INLINE void store(R *p, V v) { *(UV *)p = v; }
INLINE void accumulate(R *p, V v) { store(p, load(p) + v); }
INLINE V root(V a) { V r; for (int i = 0; i < W; ++i) r[i] = std::sqrt(a[i]); return r; }
INLINE V larger(V a, V b) { return a > b ? a : b; }
INLINE V smaller(V a, V b) { return a < b ? a : b; }
INLINE V magnitude(V a) { return a < 0 ? -a : a; }
#define LANES(name, call) \
  static __attribute__((noinline)) V name(V a) { V r; for (int i = 0; i < W; ++i) r[i] = call(a[i]); return r; }
LANES(exponential, std::exp)
LANES(logarithm, std::log)
LANES(sine, std::sin)
LANES(cosine, std::cos)
LANES(tangent, std::tanh)
static __attribute__((noinline)) V power(V a, V b) {
  V r; for (int i = 0; i < W; ++i) r[i] = std::pow(a[i], b[i]); return r;
}

#define PICK(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#define LOW(a, b) PICK(a, b, 0, 8, 1, 9, 4, 12, 5, 13)
#define HIGH(a, b) PICK(a, b, 2, 10, 3, 11, 6, 14, 7, 15)
#define EVEN(a, b) PICK(a, b, 0, 1, 8, 9, 4, 5, 12, 13)
#define ODD(a, b) PICK(a, b, 2, 3, 10, 11, 6, 7, 14, 15)
#define FRONT(a, b) PICK(a, b, 0, 1, 2, 3, 8, 9, 10, 11)
#define BACK(a, b) PICK(a, b, 4, 5, 6, 7, 12, 13, 14, 15)
INLINE H front(V a) { return PICK(a, a, 0, 1, 2, 3); }
INLINE H back(V a) { return PICK(a, a, 4, 5, 6, 7); }
INLINE V join(H a, H b) { return PICK(a, b, 0, 1, 2, 3, 4, 5, 6, 7); }
