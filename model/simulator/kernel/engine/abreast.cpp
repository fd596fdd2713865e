// As many worlds of one graph abreast as a vector has numbers, so that nothing is gathered or turned.
//
// Of a frame, whatever there is one of per edge, stencil, point or scene is a vector here. A state is six of them for
// each point, then for each controller; `spring_offset` and `controller_offset` are pairs of nodes, `corners` the points
// of each stencil.
enum { STATE = 6 * W, PULL = 3 * W, AT_ONCE = SINGLE ? 3 : 2, SEVERAL = 2 };

extern "C" int lanes() { return W; }

INLINE void look(const R *rows, int32_t node, V at[8]) {
  for (int k = 0; k < 6; ++k) at[k] = load(rows + STATE * int64_t(node) + W * k);
}

INLINE void pull_node(R *pulls, int32_t node, const V force[3], R sign) {
  for (int k = 0; k < 3; ++k) accumulate(pulls + PULL * int64_t(node) + W * k, sign * force[k]);
}

// Each is looked at before any pulls, so that several are under way at once: the processor's queues are too short to
// look so far ahead. They pull in the same order as one by one.
template <int count, bool both, class Law>
INLINE void pull_some(const Law &law, int64_t slot, const int32_t *ends, const R *rows, R *pulls, const V me[8],
                      V mine[3]) {
  V force[count][3];
#pragma GCC unroll 8
  for (int i = 0; i < count; ++i) {
    V other[8];
    look(rows, ends[2 * (slot + i) + 1], other);
    const Edge e = edge(between(me, other), law.rest(slot + i));
    const V scaled = law.tension(slot + i, e.length, e.rate) * e.inverse;
    for (int k = 0; k < 3; ++k) force[i][k] = scaled * e.d[k];
  }
#pragma GCC unroll 8
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) mine[k] += force[i][k];
    if (both) pull_node(pulls, ends[2 * (slot + i) + 1], force[i], -1);
  }
}

// `both`: the second ends are points, too. What a point knows and bears stays at hand while edges that begin at it
// follow each other.
template <bool both, class Law>
INLINE void pull_abreast(const Law &law, int64_t edges, const int32_t *ends, const R *rows, R *pulls) {
  for (int64_t slot = 0, last; slot < edges;) {
    const int32_t first = ends[2 * slot];
    R *const borne = pulls + PULL * int64_t(first);
    for (last = slot + 1; last < edges && ends[2 * last] == first;) ++last;
    V me[8], mine[3];
    look(rows, first, me);
    for (int k = 0; k < 3; ++k) mine[k] = load(borne + W * k);
    for (; slot + SEVERAL <= last; slot += SEVERAL) pull_some<SEVERAL, both>(law, slot, ends, rows, pulls, me, mine);
    for (; slot < last; ++slot) pull_some<1, both>(law, slot, ends, rows, pulls, me, mine);
    for (int k = 0; k < 3; ++k) store(borne + W * k, mine[k]);
  }
}

// Each looks before any pulls, so that laws of several stencils can be under way at once, which was measured to be
// faster. They pull in the same order as one by one.
template <int count, class Law>
INLINE void bend_some(const Law &law, int64_t first, const int32_t *corners, const R *rows, R *pulls) {
  enum { SIZE = Law::SIZE };
  V force[count][SIZE][3];
#pragma GCC unroll 8
  for (int i = 0; i < count; ++i) {
    V at[SIZE][8];
    for (int c = 0; c < SIZE; ++c) look(rows, corners[SIZE * (first + i) + c], at[c]);
    law.forces(first + i, at, force[i]);
  }
#pragma GCC unroll 8
  for (int i = 0; i < count; ++i)
    for (int c = 0; c < SIZE; ++c) pull_node(pulls, corners[SIZE * (first + i) + c], force[i][c], 1);
}

static void bend_abreast(const Frame &f, int64_t step, R *pulls) {
  each_stencil(f, step, [&](auto &law, int term) {
    int64_t slot = 0;
    for (; slot + AT_ONCE <= f.groups[term]; slot += AT_ONCE)
      bend_some<AT_ONCE>(law, slot, f.corners[term], f.rows, pulls);
    for (; slot < f.groups[term]; ++slot) bend_some<1>(law, slot, f.corners[term], f.rows, pulls);
  });
}

// What pulls at the points is left at zero for the next substep.
static void move_abreast(const Frame &f, R *pulls) {
  const V dt = splat(R(f.dt)), none = splat(0);
  for (int64_t point = 0; point < f.slices; ++point) {
    V me[8], out[8];
    look(f.rows, int32_t(point), me);
    const V mobility = load(f.inverse_mass + W * point), factor = load(f.factor + W * point);
    for (int k = 0; k < 3; ++k) {
      R *pull = pulls + PULL * point + W * k;
      out[3 + k] = (me[3 + k] + dt * (load(f.gravity + W * k) + load(pull) * mobility)) * factor;
      store(pull, none);
    }
    land(f, point, me, out);
    for (int k = 0; k < 6; ++k) store(f.rows + STATE * point + W * k, out[k]);
  }
}

INLINE void place_abreast(const Frame &f, int64_t substep) {
  const V share = splat(R(double(substep + 1) / double(f.count))), interval = splat(R(f.interval));
  for (int64_t c = 0; c < f.controllers; ++c)
    for (int k = 0; k < 3; ++k) {
      const V before = load(f.before + PULL * c + W * k), way = load(f.after + PULL * c + W * k) - before;
      R *row = f.rows + STATE * (f.slices + c) + W * k;
      store(row, before + way * share);
      store(row + PULL, way / interval);
    }
}

extern "C" void abreast(const Frame *frames, int groups, int threads) {
  std::atomic<int> taken(0);
#pragma omp parallel num_threads(threads)
  for (int g; (g = taken.fetch_add(1)) < groups;) {
    const Frame &f = frames[g];
    for (int64_t step = 0; step < f.steps; ++step) {
      place_abreast(f, f.first + step);
      const Springs springs(f, step);
      const Controllers controllers(f, step);
      if (SPRINGS) pull_abreast<true>(springs, f.spring_rows, f.spring_offset, f.rows, f.sums);
      if (CONTROLLERS) pull_abreast<false>(controllers, f.controller_rows, f.controller_offset, f.rows, f.sums);
      if (STENCILS) bend_abreast(f, step, f.sums);
      move_abreast(f, f.sums);
    }
  }
}
