// Laws of small groups of points: what their corners do goes into rows, which the points collect.

// The stencils [begin, end) of all laws, counted in eights.
template <class Do>
INLINE void stencils_of(const Frame &f, int64_t step, int64_t begin, int64_t end, Do go) {
  int64_t passed = 0;
  each_stencil(f, step, [&](auto &law, int term) {
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

static void bend(const Frame &f, int64_t step, const R *rows, int64_t begin, int64_t end) {
  stencils_of(f, step, begin, end, [&](auto &law, int term, int64_t group) {
    enum { SIZE = std::remove_reference_t<decltype(law)>::SIZE };
    V at[SIZE][8], force[SIZE][3];
    for (int c = 0; c < SIZE; ++c) gather(rows, f.corners[term] + W * (SIZE * group + c), at[c]);
    law.forces(group, at, force);
    for (int c = 0; c < SIZE; ++c) {
      V out[4] = {force[c][0], force[c][1], force[c][2], splat(0)};
      scatter_short(f.corner_forces + SHORT * (f.corner_row[term] + W * (SIZE * group + c)), out);
    }
  });
}

static void bend_back(const Frame &f, int64_t step, const R *rows, const R *pulls, int64_t begin, int64_t end) {
  stencils_of(f, step, begin, end, [&](auto &law, int term, int64_t group) {
    enum { SIZE = std::remove_reference_t<decltype(law)>::SIZE };
    V at[SIZE][8], pulled[SIZE][4], force[SIZE][3], bar[SIZE][6];
    for (int c = 0; c < SIZE; ++c) {
      const int32_t *where = f.corners[term] + W * (SIZE * group + c);
      gather(rows, where, at[c]);
      gather_short(pulls, where, pulled[c]);
    }
    law.pull_back(group, at, pulled, force, bar);
    for (int c = 0; c < SIZE; ++c) {
      V work = pulled[c][0] * force[c][0] + pulled[c][1] * force[c][1] + pulled[c][2] * force[c][2];
      V out[8] = {bar[c][0], bar[c][1], bar[c][2], bar[c][3], bar[c][4], bar[c][5], work, splat(0)};
      scatter(f.corner_adjoints + ROW * (f.corner_row[term] + W * (SIZE * group + c)), out);
    }
  });
}

INLINE void collect(const Frame &f, int64_t slice, V reaction[4]) {
  for (int64_t slot = f.incidence_start[slice]; slot < f.incidence_start[slice + 1]; ++slot) {
    V one[4];
    gather_short(f.corner_forces, f.incidence_offset + W * slot, one);
    for (int k = 0; k < 3; ++k) reaction[k] -= one[k];
  }
}

INLINE void collect_adjoint(const Frame &f, int64_t slice, V flow[8]) {
  for (int64_t slot = f.incidence_start[slice]; slot < f.incidence_start[slice + 1]; ++slot) {
    V one[8];
    gather(f.corner_adjoints, f.incidence_offset + W * slot, one);
    for (int k = 0; k < 7; ++k) flow[k] += one[k];
  }
}
