// A substep of semi-implicit Euler, and a frame of them.

// What the springs of a piece pull with at both of their ends: minus the force.
static void pull_springs(const Frame &f, int64_t step, const R *rows, R *to, int64_t piece) {
  const Springs springs(f, step);
  R *sums = sums_of(f, piece, SHORT);
  for (int64_t slice = f.piece_start[piece]; slice < f.piece_start[piece + 1]; ++slice) {
    V me[8], reaction[4] = {splat(0), splat(0), splat(0), splat(0)};
    claim(to + ROW * W * slice);
    gather(rows + ROW * W * slice, NEXT, me);
    pull<true>(springs, {f.spring_offset, f.spring_start[slice], f.spring_start[slice + 1]}, rows, me, reaction, sums);
    add_short(sums + SHORT * W * slice, NEXT, reaction);
  }
}

// `lands`: all of a substep; otherwise places stay, for points that are yet to meet.
template <bool lands>
static void move(const Frame &f, int64_t step, const R *from, R *to, int64_t begin, int64_t end) {
  const V dt = splat(R(f.dt)), zero = splat(0);
  const Controllers controllers(f, step);
  for (int64_t slice = begin; slice < end; ++slice) {
    V me[8], reaction[4] = {zero, zero, zero, zero}, out[8];
    gather(from + ROW * W * slice, NEXT, me);
    if (SPRINGS) {
      V pulled[SHORT] = {zero, zero, zero, zero};
      take_sums<SHORT>(f, slice, pulled);
      columns_short(pulled, reaction);
    }
    const int64_t *held = f.controller_start + slice;
    if (CONTROLLERS)
      pull<false>(controllers, {f.controller_offset, held[0], held[1]}, from, me, reaction, nullptr);
    if (STENCILS) collect(f, slice, reaction);
    const V mobility = load(f.inverse_mass + W * slice), factor = load(f.factor + W * slice);
    for (int k = 0; k < 3; ++k) out[3 + k] = (me[3 + k] + dt * (f.gravity[k] - reaction[k] * mobility)) * factor;
    if (lands) {
      land(f, slice, me, out);
    } else {
      for (int k = 0; k < 3; ++k) out[k] = me[k];
      out[6] = out[7] = zero;
    }
    scatter(to + ROW * W * slice, out);
  }
  if (begin == 0) place(f, f.first + step + 1, to);
}

static void settle(const Frame &f, R *rows, int64_t begin, int64_t end) {
  for (int64_t slice = begin; slice < end; ++slice) {
    V me[8], out[8];
    gather(rows + ROW * W * slice, NEXT, me);
    for (int k = 3; k < 6; ++k) out[k] = me[k];
    land(f, slice, me, out);
    scatter(rows + ROW * W * slice, out);
  }
}

static void advance(const Frame &f, Team &team, int thread, Meeting &meeting) {
  const auto slices = [&](int64_t piece) { return f.piece_start[piece]; };
  int64_t phase = 0;
  for (int64_t step = 0; step < f.steps; ++step) {
    const R *from = state(f, step % f.ring);
    R *to = state(f, (step + 1) % f.ring);
    if (STENCILS)
      team.share_many(phase++, thread, all_groups(f), [&](int64_t first, int64_t last) { bend(f, step, from, first, last); });
    if (SPRINGS) team.share(phase++, thread, f.pieces, [&](int64_t piece) { pull_springs(f, step, from, to, piece); });
    if (!f.meeting) {
      team.share(phase++, thread, f.pieces,
                 [&](int64_t piece) { move<true>(f, step, from, to, slices(piece), slices(piece + 1)); });
      continue;
    }
    team.share(phase++, thread, f.pieces,
               [&](int64_t piece) { move<false>(f, step, from, to, slices(piece), slices(piece + 1)); });
    team.share(phase++, thread, 1, [&](int64_t) { meeting.act(f, to); });
    team.share(phase++, thread, f.pieces, [&](int64_t piece) { settle(f, to, slices(piece), slices(piece + 1)); });
  }
}

extern "C" void forward(const Frame *frames, int batch, int threads) {
  for (int b = 0; b < batch; ++b) place(frames[b], frames[b].first, frames[b].rows);
  std::vector<Meeting> meetings(batch);
  share_out(frames, batch, threads,
            [&](const Frame &f, Team &team, int thread) { advance(f, team, thread, meetings[&f - frames]); });
}
