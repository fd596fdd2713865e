// One frame of semi-implicit Euler over a spring graph, and its adjoint.
//
// Eight points make a slice: the lanes of a vector. A point's row is [x y z vx vy vz approach kept]; the rows
// of a slot's eight neighbours are loaded whole and transposed in registers. Every point gathers from its own
// springs (each spring has a slot at both of its ends), so nothing is scattered, nothing is atomic, and sums
// do not depend on the number of threads. Vector extensions only: any CPU that GCC or clang compiles for.
//
// Before this text come `typedef … R;` and `typedef … N;`, the number and the whole number of the same size, and
// the macros SINGLE, GROUND, SPRINGS, CONTROLLERS and STENCILS. The traced laws take the place of the line that
// says so.
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
static int omp_get_num_threads() { return 1; }
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

// Square of the length below which an edge has no direction, and slip below which there is nothing to rub away.
static const R SHORTEST_SQUARED = R(1e-24), SLOWEST = R(1e-12);

// Mirrored by `Frame` in call.py. Pointers to a value per slot hold W values per slot row.
struct Frame {
  int64_t slices, controllers, count, first, steps, ring, keep;  // keep: memory of every substep, not of the last
  double dt, interval;
  const int64_t *partition;                                  // [threads]: first slice of each
  const int64_t *spring_start, *controller_start;            // [slices + 1] slot rows
  const int32_t *spring_offset, *controller_offset;          // per slot: where the other end's row begins
  int64_t spring_rows, controller_rows;                      // slot rows in all
  const int64_t *groups, *corner_row;                        // per stencil law: eights, and where its corners begin
  const int32_t *const *corners;                             // per stencil law: where points' rows begin [.][size][W]
  const int64_t *incidence_start;                            // [slices + 1] slot rows: the corners that a point is
  const int32_t *incidence_offset;                           // per slot: where the corner's row begins
  R *corner_forces, *corner_adjoints;                        // [corner][8], the last one zero
  R *rows;                                                   // [ring][row][8]
  const R *before, *after;                                   // controllers at the ends of the frame [.][3]
  const R *inverse_mass, *factor, *restitution, *friction, *height;  // per point
  const R *gravity;                                          // [3]
  const R *const *edge;                                      // constants of the laws, per slot
  const R *scene;                                            // constants of the laws, one value each
  R *const *memory;                                          // per slot: [ring or 1][slot rows][W]
  // the adjoint
  R *adjoint;                                                // [slice][6][W]: of the state, in and out
  R *pulls[2];                                               // [row][8], half filled: of the net force
  R *const *memory_adjoint;                                  // per slot, in and out
  R *const *edge_gradient;                                   // per slot; null where not wanted
  R *const *scene_gradient;                                  // per point; null where not wanted
  R *inverse_mass_gradient, *factor_gradient, *restitution_gradient, *friction_gradient;  // per point or null
  R *gravity_gradient;                                       // [slice][3][W] or null
  R *held_gradient;                                          // [6][controller slots] or null
};

INLINE V splat(R a) { return V{a, a, a, a, a, a, a, a}; }
INLINE V load(const R *p) { return *(const UV *)p; }
INLINE void store(R *p, V v) { *(UV *)p = v; }
INLINE H load_short(const R *p) { return *(const UH *)p; }
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
INLINE V join(H a, H b) { return PICK(a, b, 0, 1, 2, 3, 4, 5, 6, 7); }
#if SINGLE && defined(__AVX__) && !defined(__clang__)
// Said plainly, GCC loads the second half first and then shuffles: one operation more on the busiest units.
INLINE V pair(const R *a, const R *b) {
  return __builtin_ia32_vinsertf128_ps256(__builtin_ia32_ps256_ps(load_short(a)), load_short(b), 1);
}
#else
INLINE V pair(const R *a, const R *b) { return join(load_short(a), load_short(b)); }
#endif

// The first four entries of eight rows, by lane.
INLINE void quad(const R *rows, const int32_t *at, V &a, V &b, V &c, V &d) {
  V q0 = pair(rows + at[0], rows + at[4]);
  V q1 = pair(rows + at[1], rows + at[5]);
  V q2 = pair(rows + at[2], rows + at[6]);
  V q3 = pair(rows + at[3], rows + at[7]);
  V l0 = LOW(q0, q1), l1 = LOW(q2, q3), h0 = HIGH(q0, q1), h1 = HIGH(q2, q3);
  a = EVEN(l0, l1); b = ODD(l0, l1); c = EVEN(h0, h1); d = ODD(h0, h1);
}

// Positions and velocities of eight rows, by lane.
INLINE void gather(const R *rows, const int32_t *at, V out[6]) {
  V unused0, unused1;
  quad(rows, at, out[0], out[1], out[2], out[3]);
  quad(rows + SHORT, at, out[4], out[5], unused0, unused1);
}

static const int32_t NEXT[W] = {0, ROW, 2 * ROW, 3 * ROW, 4 * ROW, 5 * ROW, 6 * ROW, 7 * ROW};

// Eight vectors as eight rows.
INLINE void scatter(R *rows, const V in[8]) {
  V t[8], u[8];
  for (int i = 0; i < 8; i += 2) { t[i] = LOW(in[i], in[i + 1]); t[i + 1] = HIGH(in[i], in[i + 1]); }
  for (int i = 0; i < 8; i += 4) {
    u[i] = EVEN(t[i], t[i + 2]); u[i + 1] = ODD(t[i], t[i + 2]);
    u[i + 2] = EVEN(t[i + 1], t[i + 3]); u[i + 3] = ODD(t[i + 1], t[i + 3]);
  }
  for (int i = 0; i < 4; ++i) {
    store(rows + ROW * i, PICK(u[i], u[i + 4], 0, 1, 2, 3, 8, 9, 10, 11));
    store(rows + ROW * (i + 4), PICK(u[i], u[i + 4], 4, 5, 6, 7, 12, 13, 14, 15));
  }
}

INLINE void store_short(R *p, V a) {
  H low = PICK(a, a, 0, 1, 2, 3), high = PICK(a, a, 4, 5, 6, 7);
  *(UH *)p = low;
  *(UH *)(p + 4 * ROW) = high;
}

// Four vectors as the first halves of eight rows.
INLINE void scatter_short(R *rows, const V in[4]) {
  V l0 = LOW(in[0], in[1]), h0 = HIGH(in[0], in[1]), l1 = LOW(in[2], in[3]), h1 = HIGH(in[2], in[3]);
  store_short(rows, EVEN(l0, l1));
  store_short(rows + ROW, ODD(l0, l1));
  store_short(rows + 2 * ROW, EVEN(h0, h1));
  store_short(rows + 3 * ROW, ODD(h0, h1));
}

struct Edge { V d[3], w[3], length, inverse, rate; };

// An edge without a direction pulls nowhere; a slot that only fills its slice up is one, from a point to itself.
// It is taken to be at rest, where every law is finite.
INLINE Edge edge(const V me[6], const V other[6], V rest) {
  Edge e;
  V square = splat(0);
  for (int k = 0; k < 3; ++k) { e.d[k] = other[k] - me[k]; square += e.d[k] * e.d[k]; }
  M directed = square > SHORTEST_SQUARED;
#if SINGLE && defined(__AVX__) && !defined(__clang__)
#if defined(__AVX512VL__)
  V guess = __builtin_ia32_rsqrt14ps256_mask(square, splat(0), -1);
#else
  V guess = __builtin_ia32_rsqrtps256(square);
#endif
  guess = guess * (R(1.5) - R(0.5) * square * guess * guess);
  e.inverse = directed ? guess : splat(0);
  e.length = directed ? square * guess : rest;
#else
  e.length = directed ? root(square) : rest;
  e.inverse = directed ? 1 / e.length : splat(0);
#endif
  V along = splat(0);
  for (int k = 0; k < 3; ++k) {
    e.w[k] = other[3 + k] - me[3 + k];
    along += e.w[k] * e.d[k];
  }
  e.rate = along * e.inverse;
  return e;
}

// THE LAWS

struct Fetched { V at[6], pulled[3]; };

// Three slots are under way at once: one is fetched while the one before it is looked at and the one before that
// acts. One after the other they would leave the processor waiting: its queues are too short to look so far ahead.
template <class Law>
INLINE void pull(const Law &law, const int32_t *offset, int64_t begin, int64_t end, const R *rows, const V me[6],
                 V force[3]) {
  const auto fetch = [&](int64_t slot) {
    Fetched far;
    gather(rows, offset + W * slot, far.at);
    return far;
  };
  const auto see = [&](int64_t slot, const Fetched &far) { return edge(me, far.at, law.rest(slot)); };
  const auto act = [&](int64_t slot, const Edge &e) {
    V scaled = law.tension(slot, e.length, e.rate) * e.inverse;
    for (int k = 0; k < 3; ++k) force[k] += scaled * e.d[k];
  };
  if (begin == end) return;
  Fetched far = fetch(begin);
  Edge next = see(begin, far);
  if (begin + 1 < end) {
    far = fetch(begin + 1);
    for (int64_t slot = begin; slot < end - 2; ++slot) {
      const Edge now = next;
      const Fetched here = far;
      far = fetch(slot + 2);
      next = see(slot + 1, here);
      act(slot, now);
    }
    act(end - 2, next);
    next = see(end - 1, far);
  }
  act(end - 1, next);
}

INLINE void place(const Frame &f, int64_t substep, R *rows) {
  const R share = R(double(substep + 1) / double(f.count));
  for (int64_t c = 0; c < f.controllers; ++c) {
    R *row = rows + ROW * (W * f.slices + c);
    for (int k = 0; k < 3; ++k) {
      const R way = f.after[3 * c + k] - f.before[3 * c + k];
      row[k] = f.before[3 * c + k] + way * share;
      row[3 + k] = way / R(f.interval);
    }
    row[6] = row[7] = 0;
  }
}

// Who does what: each thread has a share of every phase, in pieces. Who is done with its own takes pieces of
// others', and the next phase begins when all pieces are done - not when all threads are there, so one that the
// system has put aside holds nobody up.
struct Team {
  enum { PIECES = 8, PATIENCE = 40000 };
  int threads;
  std::vector<std::atomic<int32_t>> taken, done;
  Team(int threads, int64_t phases) : threads(threads), taken(phases * threads), done(phases) {}

  template <class Bound, class Work>
  LAW void share(int64_t phase, int thread, Bound bound, Work work) {
    if (threads == 1) return work(bound(0), bound(1));
    for (int other = 0; other < threads; ++other) {
      const int owner = (thread + other) % threads;
      const int64_t begin = bound(owner), length = bound(owner + 1) - begin;
      for (int64_t piece; (piece = taken[phase * threads + owner].fetch_add(1)) < PIECES;) {
        work(begin + length * piece / PIECES, begin + length * (piece + 1) / PIECES);
        done[phase].fetch_add(1, std::memory_order_release);
      }
    }
    for (int spin = 0; done[phase].load(std::memory_order_acquire) < threads * PIECES; ++spin)
      if (spin > PATIENCE) sched_yield();
  }
};

// The stencils [begin, end) of all laws, counted in eights.
template <class Do>
INLINE void stencils_of(const Frame &f, int64_t begin, int64_t end, Do go) {
  int64_t passed = 0;
  each_stencil(f, [&](auto &law, int term) {
    const int64_t from = begin > passed ? begin - passed : 0, here = f.groups[term];
    for (int64_t group = from; group < here && group < end - passed; ++group) go(law, term, group);
    passed += here;
  });
}

INLINE int64_t all_groups(const Frame &f) {
  int64_t sum = 0;
  for (int term = 0; term < STENCILS; ++term) sum += f.groups[term];
  return sum;
}

static void bend(const Frame &f, const R *rows, int64_t begin, int64_t end) {
  stencils_of(f, begin, end, [&](auto &law, int term, int64_t group) {
    enum { SIZE = std::remove_reference_t<decltype(law)>::SIZE };
    V at[SIZE][6], force[SIZE][3];
    for (int c = 0; c < SIZE; ++c) gather(rows, f.corners[term] + W * (SIZE * group + c), at[c]);
    law.forces(group, at, force);
    for (int c = 0; c < SIZE; ++c) {
      V out[4] = {force[c][0], force[c][1], force[c][2], splat(0)};
      scatter_short(f.corner_forces + ROW * (f.corner_row[term] + W * (SIZE * group + c)), out);
    }
  });
}

static void bend_back(const Frame &f, const R *rows, const R *pulls, int64_t begin, int64_t end) {
  stencils_of(f, begin, end, [&](auto &law, int term, int64_t group) {
    enum { SIZE = std::remove_reference_t<decltype(law)>::SIZE };
    V at[SIZE][6], pulled[SIZE][3], force[SIZE][3], bar[SIZE][6], unused;
    for (int c = 0; c < SIZE; ++c) {
      const int32_t *where = f.corners[term] + W * (SIZE * group + c);
      gather(rows, where, at[c]);
      quad(pulls, where, pulled[c][0], pulled[c][1], pulled[c][2], unused);
    }
    law.pull_back(group, at, pulled, force, bar);
    for (int c = 0; c < SIZE; ++c) {
      const int64_t row = ROW * (f.corner_row[term] + W * (SIZE * group + c));
      V acts[4] = {force[c][0], force[c][1], force[c][2], splat(0)};
      V out[8] = {bar[c][0], bar[c][1], bar[c][2], bar[c][3], bar[c][4], bar[c][5], splat(0), splat(0)};
      scatter_short(f.corner_forces + row, acts);
      scatter(f.corner_adjoints + row, out);
    }
  });
}

INLINE void collect(const Frame &f, int64_t slice, V force[3]) {
  for (int64_t slot = f.incidence_start[slice]; slot < f.incidence_start[slice + 1]; ++slot) {
    V one[3], unused;
    quad(f.corner_forces, f.incidence_offset + W * slot, one[0], one[1], one[2], unused);
    for (int k = 0; k < 3; ++k) force[k] += one[k];
  }
}

INLINE void collect_adjoint(const Frame &f, int64_t slice, V bar[6]) {
  for (int64_t slot = f.incidence_start[slice]; slot < f.incidence_start[slice + 1]; ++slot) {
    V one[6];
    gather(f.corner_adjoints, f.incidence_offset + W * slot, one);
    for (int k = 0; k < 6; ++k) bar[k] += one[k];
  }
}

static void move(const Frame &f, int64_t step, const R *from, R *to, int64_t begin, int64_t end) {
  const V dt = splat(R(f.dt));
  const Springs springs(f, step);
  const Controllers controllers(f, step);
  for (int64_t slice = begin; slice < end; ++slice) {
    V me[6], force[3] = {splat(0), splat(0), splat(0)};
    gather(from + ROW * W * slice, NEXT, me);
    if (SPRINGS) pull(springs, f.spring_offset, f.spring_start[slice], f.spring_start[slice + 1], from, me, force);
    if (CONTROLLERS)
      pull(controllers, f.controller_offset, f.controller_start[slice], f.controller_start[slice + 1], from, me,
           force);
    if (STENCILS) collect(f, slice, force);
    const V mobility = load(f.inverse_mass + W * slice), factor = load(f.factor + W * slice);
    V out[8];
    for (int k = 0; k < 3; ++k) out[3 + k] = (me[3 + k] + dt * (force[k] * mobility + f.gravity[k])) * factor;
    out[6] = out[7] = splat(0);
    if (GROUND) {
      const V mu = load(f.friction + W * slice), e = load(f.restitution + W * slice);
      M meets = (me[2] + dt * out[5] < load(f.height + W * slice)) & (out[5] < 0);
      V approach = meets ? -out[5] : splat(0);
      V slip = larger(root(out[3] * out[3] + out[4] * out[4]), splat(SLOWEST));
      V kept = larger(1 - mu * (1 + e) * approach / slip, splat(0));
      kept = meets ? kept : splat(1);
      out[3] *= kept;
      out[4] *= kept;
      out[5] = meets ? e * approach : out[5];
      out[6] = approach;
      out[7] = kept;
    }
    for (int k = 0; k < 3; ++k) out[k] = me[k] + dt * out[3 + k];
    scatter(to + ROW * W * slice, out);
  }
  if (begin == 0 && end > 0) place(f, f.first + step + 1, to);
}

static void advance(const Frame &f, Team &team, int thread) {
  const int64_t stride = ROW * (W * f.slices + f.controllers), groups = all_groups(f);
  const auto slices = [&](int owner) { return owner < team.threads ? f.partition[owner] : f.slices; };
  const auto eights = [&](int owner) { return groups * owner / team.threads; };
  int64_t phase = 0;
  for (int64_t step = 0; step < f.steps; ++step) {
    const R *from = f.rows + stride * (step % f.ring);
    R *to = f.rows + stride * ((step + 1) % f.ring);
    if (STENCILS)
      team.share(phase++, thread, eights, [&](int64_t begin, int64_t end) { bend(f, from, begin, end); });
    team.share(phase++, thread, slices, [&](int64_t begin, int64_t end) { move(f, step, from, to, begin, end); });
  }
}

// From the adjoint of the state after a substep: that of the net force, for the neighbours to see, and the part
// of that of the state before it which needs no neighbour.
INLINE void local(const Frame &f, int64_t slice, const R *after, V xbar[3], V vbar[3], R *pulls) {
  const V dt = splat(R(f.dt)), mobility = load(f.inverse_mass + W * slice), factor = load(f.factor + W * slice);
  V now[6], approach, kept, unused0, unused1, ubar[3], u[3];
  quad(after + ROW * W * slice, NEXT, unused0, unused1, now[2], now[3]);
  quad(after + ROW * W * slice + SHORT, NEXT, now[4], now[5], approach, kept);
  for (int k = 0; k < 3; ++k) { ubar[k] = vbar[k] + dt * xbar[k]; u[k] = now[3 + k]; }
  if (GROUND) {
    const V mu = load(f.friction + W * slice), e = load(f.restitution + W * slice), zero = splat(0);
    M meets = approach > 0, slides = meets & (kept > 0);
    u[0] = slides ? u[0] / kept : u[0];
    u[1] = slides ? u[1] / kept : u[1];
    u[2] = meets ? -approach : u[2];
    V slip = larger(root(u[0] * u[0] + u[1] * u[1]), splat(SLOWEST));
    V keptbar = slides ? ubar[0] * u[0] + ubar[1] * u[1] : zero;
    V ratio = slides ? approach / slip : zero;
    V slipbar = slides ? keptbar * mu * (1 + e) * ratio / slip : zero;
    if (f.restitution_gradient)
      accumulate(f.restitution_gradient + W * slice, (meets ? ubar[2] * approach : zero) - keptbar * mu * ratio);
    if (f.friction_gradient) accumulate(f.friction_gradient + W * slice, -keptbar * (1 + e) * ratio);
    V approachbar = e * ubar[2] - (slides ? keptbar * mu * (1 + e) / slip : zero);
    V along = slides ? slipbar / slip : zero;
    V keeps = meets ? kept : splat(1);
    ubar[0] = keeps * ubar[0] + along * u[0];
    ubar[1] = keeps * ubar[1] + along * u[1];
    ubar[2] = meets ? -approachbar : ubar[2];
  }
  if (f.factor_gradient)
    accumulate(f.factor_gradient + W * slice, (ubar[0] * u[0] + ubar[1] * u[1] + ubar[2] * u[2]) / factor);
  V out[4] = {splat(0), splat(0), splat(0), splat(0)};
  for (int k = 0; k < 3; ++k) {
    vbar[k] = ubar[k] * factor;
    if (f.gravity_gradient) accumulate(f.gravity_gradient + W * (3 * slice + k), dt * vbar[k]);
    out[k] = vbar[k] * dt * mobility;
  }
  scatter_short(pulls + ROW * W * slice, out);
}

// `other` may be a controller, on which nothing acts: `free` says whether the pull is on both ends. `weighs`: the
// force itself is wanted too.
template <bool free, bool weighs, class Law>
INLINE void pull_back(Law &law, const int32_t *offset, int64_t begin, int64_t end, const R *rows, const R *pulls,
                      const V me[6], const V mine[3], V force[3], V xbar[3], V vbar[3], R *held, int64_t held_stride,
                      V share, V pace) {
  const auto fetch = [&](int64_t slot) {
    Fetched far;
    V unused;
    gather(rows, offset + W * slot, far.at);
    if (free) quad(pulls, offset + W * slot, far.pulled[0], far.pulled[1], far.pulled[2], unused);
    return far;
  };
  const auto act = [&](int64_t slot, const Fetched &far) {
    const Edge e = edge(me, far.at, law.rest(slot));
    V pulled[3], lengthbar, ratebar, along = splat(0);
    for (int k = 0; k < 3; ++k) {
      pulled[k] = free ? mine[k] - far.pulled[k] : mine[k];
      along += pulled[k] * e.d[k];
    }
    const V tensionbar = along * e.inverse;
    const V tension = law.pull_back(slot, e.length, e.rate, tensionbar, lengthbar, ratebar);
    // f = (T/l) d, l' = w·d/l: what each passes on to d and w, split into parts along d, `pulled` and w.
    V scaled = tension * e.inverse, paced = ratebar * e.inverse;
    V axial = (lengthbar - scaled * tensionbar - paced * e.rate) * e.inverse;
    for (int k = 0; k < 3; ++k) {
      if (weighs) force[k] += scaled * e.d[k];
      vbar[k] -= paced * e.d[k];
      if (!free && held) {
        V dbar = axial * e.d[k] + scaled * pulled[k] + paced * e.w[k], wbar = paced * e.d[k];
        accumulate(held + held_stride * k + W * slot, (1 - share) * dbar - pace * wbar);
        accumulate(held + held_stride * (3 + k) + W * slot, share * dbar + pace * wbar);
      }
      xbar[k] -= axial * e.d[k];
      xbar[k] -= scaled * pulled[k];
      xbar[k] -= paced * e.w[k];
    }
  };
  if (begin == end) return;
  Fetched next = fetch(begin);
  for (int64_t slot = begin; slot < end - 1; ++slot) {
    const Fetched now = next;
    next = fetch(slot + 1);
    act(slot, now);
  }
  act(end - 1, next);
}

static void end(const Frame &f, int64_t first, int64_t last) {
  const R *after = f.rows + ROW * (W * f.slices + f.controllers) * f.steps;
  for (int64_t slice = first; slice < last; ++slice) {
    V bar[6];
    for (int k = 0; k < 6; ++k) bar[k] = load(f.adjoint + W * (6 * slice + k));
    local(f, slice, after, bar, bar + 3, f.pulls[f.steps & 1]);
    for (int k = 0; k < 6; ++k) store(f.adjoint + W * (6 * slice + k), bar[k]);
  }
}

template <bool weighs>
static void move_back(const Frame &f, int64_t step, const R *rows, const R *pulls, int64_t begin, int64_t end) {
  const int64_t held_stride = W * f.controller_rows;
  const V share = splat(R(double(f.first + step + 1) / double(f.count))), pace = splat(R(1 / f.interval));
  for (int64_t slice = begin; slice < end; ++slice) {
    Springs springs(f, step);
    Controllers controllers(f, step);
    V me[6], mine[3], unused, bar[6], force[3] = {splat(0), splat(0), splat(0)};
    gather(rows + ROW * W * slice, NEXT, me);
    quad(pulls + ROW * W * slice, NEXT, mine[0], mine[1], mine[2], unused);
    for (int k = 0; k < 6; ++k) bar[k] = load(f.adjoint + W * (6 * slice + k));
    const int64_t *own = f.spring_start + slice, *held = f.controller_start + slice;
    if (SPRINGS)
      pull_back<true, weighs>(springs, f.spring_offset, own[0], own[1], rows, pulls, me, mine, force, bar, bar + 3,
                              nullptr, 0, share, pace);
    if (CONTROLLERS)
      pull_back<false, weighs>(controllers, f.controller_offset, held[0], held[1], rows, pulls, me, mine, force, bar,
                               bar + 3, f.held_gradient, held_stride, share, pace);
    if (SPRINGS) springs.finish(f, slice);
    if (CONTROLLERS) controllers.finish(f, slice);
    if (STENCILS) collect_adjoint(f, slice, bar);
    if (weighs) {
      if (STENCILS) collect(f, slice, force);
      V sum = mine[0] * force[0] + mine[1] * force[1] + mine[2] * force[2];
      accumulate(f.inverse_mass_gradient + W * slice, sum / load(f.inverse_mass + W * slice));
    }
    if (step) local(f, slice, rows, bar, bar + 3, f.pulls[step & 1]);
    for (int k = 0; k < 6; ++k) store(f.adjoint + W * (6 * slice + k), bar[k]);
  }
}

static void retreat(const Frame &f, Team &team, int thread) {
  const int64_t stride = ROW * (W * f.slices + f.controllers), groups = all_groups(f);
  const auto slices = [&](int owner) { return owner < team.threads ? f.partition[owner] : f.slices; };
  const auto eights = [&](int owner) { return groups * owner / team.threads; };
  const auto back = f.inverse_mass_gradient ? move_back<true> : move_back<false>;
  int64_t phase = 0;
  team.share(phase++, thread, slices, [&](int64_t begin, int64_t last) { end(f, begin, last); });
  for (int64_t step = f.steps - 1; step >= 0; --step) {
    const R *rows = f.rows + stride * step, *pulls = f.pulls[(step + 1) & 1];
    if (STENCILS)
      team.share(phase++, thread, eights,
                 [&](int64_t begin, int64_t last) { bend_back(f, rows, pulls, begin, last); });
    team.share(phase++, thread, slices,
               [&](int64_t begin, int64_t last) { back(f, step, rows, pulls, begin, last); });
  }
}

template <class Work>
static void share_out(const Frame *frames, int batch, int threads, Work work) {
  Team together(batch > 1 ? 1 : threads, 2 * frames[0].steps + 1);
#pragma omp parallel num_threads(threads)
  {
    const int thread = omp_get_thread_num();
    if (batch == 1)
      work(frames[0], together, thread);
    else
      for (int b = thread; b < batch; b += omp_get_num_threads()) {
        Team alone(1, 0);
        work(frames[b], alone, 0);
      }
  }
}

extern "C" void forward(const Frame *frames, int batch, int threads) {
  for (int b = 0; b < batch; ++b) place(frames[b], frames[b].first, frames[b].rows);
  share_out(frames, batch, threads, advance);
}

extern "C" void backward(const Frame *frames, int batch, int threads) { share_out(frames, batch, threads, retreat); }
