// Square of the length below which an edge has no direction, and slip below which there is nothing to rub away.
static const R SHORTEST_SQUARED = R(1e-24), SLOWEST = R(1e-12);

// Mirrored by `Frame` in call.py. Pointers to a value per slot hold W values per slot row.
struct Frame {
  int64_t slices, controllers, count, first, steps, ring, keep;  // keep: memory of every substep, not of the last
  int64_t worlds;                                            // 1, or W of them side by side (abreast.cpp)
  double dt, lasts, interval;                                // lasts: dt as laws with memory see it
  int64_t pieces;
  const int64_t *piece_start;                                // [pieces + 1] slices
  const int64_t *reach;                                      // [pieces][2] slices: whose points a piece's springs join
  const int64_t *origin;                                     // [pieces]: see `sums_of`
  const int64_t *spring_start, *controller_start;            // [slices + 1] slot rows
  const int32_t *spring_offset, *controller_offset;          // per slot: where the other end's row begins
  int64_t spring_rows, controller_rows;                      // slot rows in all
  const int64_t *groups, *corner_row;                        // per stencil law: eights, and where its corners begin
  const int32_t *const *corners;                             // per stencil law: where points' rows begin [.][size][W]
  const int64_t *incidence_start;                            // [slices + 1] slot rows: the corners that a point is
  const int32_t *incidence_offset;                           // per slot: where the corner's row begins
  R *corner_forces, *corner_adjoints;                        // [corner][4], [corner][8], the last one zero
  R *rows;                                                   // [ring][row][8]
  R *sums;                                                   // rows per piece and slice in its reach, zero between steps
  const R *before, *after;                                   // controllers at the ends of the frame [.][3]
  const R *inverse_mass, *factor, *restitution, *friction, *height;  // per point
  const R *gravity;                                          // [3]
  const R *const *edge;                                      // constants of the laws, per slot
  const R *scene;                                            // constants of the laws, one value each
  R *const *memory;                                          // per slot: [ring or 1][slot rows][W]
  int64_t points;                                            // rows that are points
  const R *meeting;                                          // square of the distance, restitution, friction; or null
  const R *rest;                                             // [point][3]: who is near there never meets
  const int64_t *joined_start;                               // [points + 1]
  const int32_t *joined;                                     // points that each is joined to and that come later
  // the adjoint
  R *adjoint;                                                // [point][8]: of the state, in and out; the rest zero
  R *pulls[2];                                               // [point][4]: of the net force
  R *const *memory_adjoint;                                  // per slot, in and out
  R *const *edge_gradient;                                   // per slot; null where not wanted
  R *const *scene_gradient;                                  // per point; null where not wanted
  R *inverse_mass_gradient, *factor_gradient, *restitution_gradient, *friction_gradient;  // per point or null
  R *gravity_gradient;                                       // [slice][3][W] or null
  R *held_gradient;                                          // [6][controller slots] or null
};

// What the springs of a piece add at points has rows of its own, so that pieces do not wait for each other; here
// they begin, counted from slice 0.
INLINE R *sums_of(const Frame &f, int64_t piece, int width) { return f.sums + width * W * f.origin[piece]; }

// Add what all pieces have for a slice to its rows, in order, and leave zeros.
template <int width>
INLINE void take_sums(const Frame &f, int64_t slice, V rows[width]) {
  for (int64_t piece = 0; piece < f.pieces; ++piece)
    if (f.reach[2 * piece] <= slice && slice < f.reach[2 * piece + 1]) {
      R *sums = sums_of(f, piece, width) + width * W * slice;
      for (int k = 0; k < width; ++k) {
        rows[k] += load(sums + W * k);
        store(sums + W * k, splat(0));
      }
    }
}

INLINE V scene(const Frame &f, int64_t index) {
  return f.worlds == 1 ? splat(f.scene[index]) : load(f.scene + W * index);
}

INLINE R *state(const Frame &f, int64_t index) {
  return f.rows + ROW * (W * f.slices + f.controllers) * index;
}

// A history is longer than the caches: what the next substep reads or writes of it is fetched while there is other
// work to do. It is read by loads, as prefetching it was measured to change nothing.
enum { LINE = 64 / sizeof(R) };
INLINE void touch(const R *rows) {
  for (int at = 0; at < ROW * W; at += LINE) (void)*(const volatile R *)(rows + at);
}
INLINE void claim(R *rows) {
  for (int at = 0; at < ROW * W; at += LINE) __builtin_prefetch(rows + at, 1);
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
