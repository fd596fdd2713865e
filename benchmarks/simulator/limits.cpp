// What bounds a substep forward, each alone; behind the text of a float32 kernel whose laws these use.

// Every array of a substep, from its beginning to its end: read, read and written twice, or written.
extern "C" void stream(const float *const *read, const int64_t *sizes, int64_t arrays, float *sums, int64_t summed,
                       float *to, int64_t written, int64_t steps) {
  V seen[4] = {};
  for (int64_t step = 0; step < steps; ++step) {
    for (int64_t a = 0; a < arrays; ++a)
      for (int64_t i = 0; i + 4 * W <= sizes[a]; i += 4 * W)
        for (int k = 0; k < 4; ++k) seen[k] = (V)((M)seen[k] ^ (M)load(read[a] + i + W * k));
    for (int pass = 0; pass < 2; ++pass)
      for (int64_t i = 0; i + W <= summed; i += W) store(sums + i, (V)((M)load(sums + i) ^ (M)seen[pass]));
    for (int64_t i = 0; i + W <= written; i += W) store(to + i, seen[0]);
    asm volatile("" : : : "memory");
  }
}

// The loads and stores of the kernel at its own addresses, and nothing else: one operation per load, so that none goes.
extern "C" void touch_all(const float *rows, float *to, float *sums, const int32_t *offset, const float *a,
                          const float *b, const int64_t *start, int64_t slices, int64_t steps) {
  typedef int32_t I __attribute__((vector_size(32)));
  typedef int32_t J __attribute__((vector_size(16)));
  typedef int32_t UI __attribute__((vector_size(32), aligned(4), may_alias));
  typedef int32_t UJ __attribute__((vector_size(16), aligned(4), may_alias));
  I bits[5] = {};
  J one = {};
  for (int64_t step = 0; step < steps; ++step)
    for (int64_t slice = 0; slice < slices; ++slice) {
      for (int64_t slot = start[slice]; slot < start[slice + 1]; ++slot) {
        const int32_t *at = offset + 8 * slot;
        for (int i = 0; i < 4; ++i) bits[i] ^= *(const UI *)(rows + at[i]) ^ *(const UI *)(rows + at[i + 4]);
        bits[4] ^= *(const UI *)(a + 8 * slot) ^ *(const UI *)(b + 8 * slot);
        for (int i = 0; i < 8; ++i) *(UJ *)(sums + at[i] / 2) ^= one;
      }
      for (int i = 0; i < 4; ++i) *(UI *)(sums + 32 * slice + 8 * i) ^= bits[i];
      for (int i = 0; i < 8; ++i) *(UI *)(to + 64 * slice + 8 * i) = bits[i % 5];
    }
}

// The arithmetic of so many slot rows, turning rows to columns and back included, on numbers that are always there.
extern "C" float calculate(int64_t slots, int64_t steps) {
  static const R some[ROW * W] = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  const R *edge_of[16], *given = some;
  R *none[16] = {};
  for (int i = 0; i < 16; ++i) edge_of[i] = some;
  Frame f{};
  f.edge = edge_of;
  f.scene = some;
  f.memory = f.memory_adjoint = f.edge_gradient = f.scene_gradient = none;
  const Springs springs(f, 0);
  struct Far { V at[8]; };
  V me[8], reaction[4] = {};
  H sum[4] = {};
  gather(some, NEXT, me);
  const auto fetch = [&](int64_t) {
    asm volatile("" : "+r"(given));  // the same numbers again, but who knows
    Far far;
    gather(given, NEXT, far.at);
    return far;
  };
  const auto see = [&](int64_t, const Far &far) { return edge(between(me, far.at), springs.rest(0)); };
  const auto act = [&](int64_t, const Edge &e) {
    const V scaled = springs.tension(0, e.length, e.rate) * e.inverse;
    const V force[4] = {scaled * e.d[0], scaled * e.d[1], scaled * e.d[2], splat(0)};
    for (int k = 0; k < 3; ++k) reaction[k] -= force[k];
    each_short_row(force, [&](int i, H one) { sum[i % 4] += one; });
  };
  overlap(0, slots * steps, fetch, see, act);
  return sum[0][0] + sum[1][0] + sum[2][0] + sum[3][0] + reaction[0][0] + reaction[1][0] + reaction[2][0];
}

// Fused multiplications and additions, eight numbers each, twelve of them independent of each other.
extern "C" float fuse(int64_t rounds) {
  enum { CHAINS = 12 };
  V sum[CHAINS], factor = splat(R(0.5));
  for (int i = 0; i < CHAINS; ++i) sum[i] = splat(R(i + 2));
  for (int64_t round = 0; round < rounds; ++round)
    for (int i = 0; i < CHAINS; ++i) sum[i] = sum[i] * factor + factor;
  R all = 0;
  for (int i = 0; i < CHAINS; ++i) all += sum[i][0];
  return all;
}
