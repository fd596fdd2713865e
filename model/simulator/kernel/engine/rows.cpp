// Rows of points, eight of which are turned into vectors and back.
//
// A state is a row of eight, [x y z vx vy vz approach kept]; what pulls at a point is a row of four. `at` says
// where the row of each lane begins; rows of four begin half as far.
typedef R H __attribute__((vector_size(SHORT * sizeof(R))));
typedef R UH __attribute__((vector_size(SHORT * sizeof(R)), aligned(sizeof(R)), may_alias));

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

static const int32_t NEXT[W] = {0, ROW, 2 * ROW, 3 * ROW, 4 * ROW, 5 * ROW, 6 * ROW, 7 * ROW};

template <class Number>
INLINE Number *short_row(Number *rows, int32_t at) {
  return (Number *)((uintptr_t)rows + int64_t(at) * int64_t(sizeof(R) / 2));
}

// In each half of the vectors: columns from rows, or rows from columns.
INLINE void turn(const V in[4], V out[4]) {
  V l0 = LOW(in[0], in[1]), l1 = LOW(in[2], in[3]), h0 = HIGH(in[0], in[1]), h1 = HIGH(in[2], in[3]);
  out[0] = EVEN(l0, l1); out[1] = ODD(l0, l1); out[2] = EVEN(h0, h1); out[3] = ODD(h0, h1);
}

// Columns of eight rows.
INLINE void columns(const V row[8], V out[8]) {
  V low[4], high[4];
  turn(row, low);
  turn(row + 4, high);
  for (int k = 0; k < 4; ++k) {
    out[k] = FRONT(low[k], high[k]);
    out[4 + k] = BACK(low[k], high[k]);
  }
}

// The same of eight short rows, of which each vector holds two that follow each other.
INLINE void columns_short(const V two[4], V out[4]) {
  const V both[4] = {FRONT(two[0], two[2]), BACK(two[0], two[2]), FRONT(two[1], two[3]), BACK(two[1], two[3])};
  turn(both, out);
}

INLINE void gather(const R *rows, const int32_t *at, V out[8]) {
  V row[8];
  for (int i = 0; i < W; ++i) row[i] = load(rows + at[i]);
  columns(row, out);
}

INLINE void gather_short(const R *rows, const int32_t *at, V out[4]) {
  V both[4];
  for (int i = 0; i < 4; ++i) {
    const R *one = short_row(rows, at[i]), *two = short_row(rows, at[i + 4]);
    both[i] = join(*(const UH *)one, *(const UH *)two);
  }
  turn(both, out);
}

// Columns as rows; `go` is told the lane and its row.
template <class Do>
INLINE void each_row(const V in[8], Do go) {
  V first[4], second[4];
  turn(in, first);
  turn(in + 4, second);
  for (int i = 0; i < 4; ++i) {
    go(i, FRONT(first[i], second[i]));
    go(i + 4, BACK(first[i], second[i]));
  }
}

template <class Do>
INLINE void each_short_row(const V in[4], Do go) {
  V both[4];
  turn(in, both);
  for (int i = 0; i < 4; ++i) {
    go(i, front(both[i]));
    go(i + 4, back(both[i]));
  }
}

INLINE void scatter(R *rows, const V in[8]) {
  each_row(in, [&](int lane, V row) { store(rows + ROW * lane, row); });
}

INLINE void scatter_short(R *rows, const V in[4]) {
  each_short_row(in, [&](int lane, H row) { *(UH *)(rows + SHORT * lane) = row; });
}

// Added one after another: the same row may come twice.
INLINE void add(R *rows, const int32_t *at, const V in[8]) {
  each_row(in, [&](int lane, V row) { accumulate(rows + at[lane], row); });
}

INLINE void add_short(R *rows, const int32_t *at, const V in[4]) {
  each_short_row(in, [&](int lane, H row) { *(UH *)short_row(rows, at[lane]) += row; });
}
