// The adjoint of a substep, and of a frame of them.
//
// From the adjoint of the state after a substep comes that of the net forces, for the neighbours to see, and the
// part of that of the state before it which needs no neighbour (`local`); then what the forces pass on.

// From the adjoint of the velocity after contact to that before it; `after` is the state after the substep.
INLINE void ground_back(const Frame &f, int64_t slice, const V after[8], V u[3], V ubar[3]) {
  const V mu = load(f.friction + W * slice), e = load(f.restitution + W * slice), zero = splat(0);
  const V approach = after[6], kept = after[7];
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

INLINE void local(const Frame &f, int64_t slice, const R *rows, V bar[8], R *pulls) {
  const V dt = splat(R(f.dt)), mobility = load(f.inverse_mass + W * slice), factor = load(f.factor + W * slice);
  V after[8], u[3], ubar[3], out[4];
  gather(rows + ROW * W * slice, NEXT, after);
  for (int k = 0; k < 3; ++k) { ubar[k] = bar[3 + k] + dt * bar[k]; u[k] = after[3 + k]; }
  if (GROUND) ground_back(f, slice, after, u, ubar);
  if (f.factor_gradient)
    accumulate(f.factor_gradient + W * slice, (ubar[0] * u[0] + ubar[1] * u[1] + ubar[2] * u[2]) / factor);
  for (int k = 0; k < 3; ++k) {
    bar[3 + k] = ubar[k] * factor;
    if (f.gravity_gradient) accumulate(f.gravity_gradient + W * (3 * slice + k), dt * bar[3 + k]);
    out[k] = bar[3 + k] * dt * mobility;
  }
  out[3] = bar[6] = bar[7] = splat(0);
  scatter_short(pulls + SHORT * W * slice, out);
}

// What the springs of a piece pass on to both of their ends.
template <bool weighs>
static void release(const Frame &f, int64_t step, const R *rows, const R *pulls, int64_t piece) {
  R *sums = sums_of(f, piece, ROW);
  for (int64_t slice = f.piece_start[piece]; slice < f.piece_start[piece + 1]; ++slice) {
    Springs springs(f, step);
    V me[8], mine[4], flow[8];
    for (int k = 0; k < 8; ++k) flow[k] = splat(0);
    gather(rows + ROW * W * slice, NEXT, me);
    gather_short(pulls + SHORT * W * slice, NEXT, mine);
    pull_back<true, weighs>(springs, {f.spring_offset, f.spring_start[slice], f.spring_start[slice + 1]}, rows, pulls,
                            me, mine, flow, sums, nullptr);
    springs.finish(f, slice);
    add(sums + ROW * W * slice, NEXT, flow);
  }
}

template <bool weighs>
static void move_back(const Frame &f, int64_t step, const R *rows, const R *pulls, int64_t begin, int64_t end) {
  const Held held = {f.held_gradient, W * f.controller_rows, splat(R(double(f.first + step + 1) / double(f.count))),
                     splat(R(1 / f.interval))};
  for (int64_t slice = begin; slice < end; ++slice) {
    V row[8], bar[8];
    if (step) touch(state(f, step - 1) + ROW * W * slice);
    for (int k = 0; k < W; ++k) row[k] = load(f.adjoint + ROW * (W * slice + k));
    if (SPRINGS) take_sums<ROW>(f, slice, row);
    columns(row, bar);
    const int64_t *start = f.controller_start + slice;
    if (CONTROLLERS && start[0] < start[1]) {
      Controllers controllers(f, step);
      V me[8], mine[4];
      gather(rows + ROW * W * slice, NEXT, me);
      gather_short(pulls + SHORT * W * slice, NEXT, mine);
      pull_back<false, weighs>(controllers, {f.controller_offset, start[0], start[1]}, rows, pulls, me, mine, bar,
                               nullptr, &held);
      controllers.finish(f, slice);
    }
    if (STENCILS) collect_adjoint(f, slice, bar);
    if (weighs) accumulate(f.inverse_mass_gradient + W * slice, bar[6] / load(f.inverse_mass + W * slice));
    if (step)
      local(f, slice, rows, bar, f.pulls[step & 1]);
    else
      bar[6] = splat(0);
    scatter(f.adjoint + ROW * W * slice, bar);
  }
}

static void begin_back(const Frame &f, int64_t begin, int64_t end) {
  for (int64_t slice = begin; slice < end; ++slice) {
    V bar[8];
    gather(f.adjoint + ROW * W * slice, NEXT, bar);
    local(f, slice, state(f, f.steps), bar, f.pulls[f.steps & 1]);
    scatter(f.adjoint + ROW * W * slice, bar);
  }
}

template <bool weighs>
static void retreat(const Frame &f, Team &team, int thread) {
  const auto slices = [&](int64_t piece) { return f.piece_start[piece]; };
  int64_t phase = 0;
  team.share(phase++, thread, f.pieces, [&](int64_t piece) { begin_back(f, slices(piece), slices(piece + 1)); });
  for (int64_t step = f.steps - 1; step >= 0; --step) {
    const R *rows = state(f, step), *pulls = f.pulls[(step + 1) & 1];
    if (STENCILS)
      team.share_many(phase++, thread, all_groups(f),
                      [&](int64_t first, int64_t last) { bend_back(f, step, rows, pulls, first, last); });
    if (SPRINGS)
      team.share(phase++, thread, f.pieces, [&](int64_t piece) { release<weighs>(f, step, rows, pulls, piece); });
    team.share(phase++, thread, f.pieces, [&](int64_t piece) {
      move_back<weighs>(f, step, rows, pulls, slices(piece), slices(piece + 1));
    });
  }
}

extern "C" void backward(const Frame *frames, int batch, int threads) {
  share_out(frames, batch, threads, frames[0].inverse_mass_gradient ? retreat<true> : retreat<false>);
}
