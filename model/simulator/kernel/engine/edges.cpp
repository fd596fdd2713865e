// Laws along edges: every point of a slice and its neighbours in one slot row, from both sides of time.

// Some slot rows of a slice: where the other ends are, and what is known there.
struct Slots { const int32_t *offset; int64_t begin, end; };

// Two slots are under way at once: one is looked at while the one before it acts. One after the other they would
// leave the processor waiting: its queues are too short to look so far ahead.
template <class See, class Act>
INLINE void overlap(int64_t begin, int64_t end, See see, Act act) {
  if (begin == end) return;
  auto next = see(begin);
  for (int64_t slot = begin; slot < end - 1; ++slot) {
    const auto now = next;
    next = see(slot + 1);
    act(slot, now);
  }
  act(end - 1, next);
}

// Three at once, where the registers hold as much: one is fetched besides.
template <class Fetch, class See, class Act>
INLINE void overlap(int64_t begin, int64_t end, Fetch fetch, See see, Act act) {
  if (begin == end) return;
  auto far = fetch(begin);
  auto next = see(begin, far);
  if (begin + 1 < end) {
    far = fetch(begin + 1);
    for (int64_t slot = begin; slot < end - 2; ++slot) {
      const auto now = next;
      const auto here = far;
      far = fetch(slot + 2);
      next = see(slot + 1, here);
      act(slot, now);
    }
    act(end - 2, next);
    next = see(end - 1, far);
  }
  act(end - 1, next);
}

// What the slots pull their points with is taken from `reaction`; `both`: and added to the `sums`
// of the other ends.
template <bool both, class Law>
INLINE void pull(const Law &law, const Slots &slots, const R *rows, const V me[8], V reaction[4], R *sums) {
  struct Far { V at[8]; };
  const auto fetch = [&](int64_t slot) {
    Far far;
    gather(rows, slots.offset + W * slot, far.at);
    return far;
  };
  const auto see = [&](int64_t slot, const Far &far) { return edge(between(me, far.at), law.rest(slot)); };
  const auto act = [&](int64_t slot, const Edge &e) {
    V scaled = law.tension(slot, e.length, e.rate) * e.inverse;
    V force[4] = {scaled * e.d[0], scaled * e.d[1], scaled * e.d[2], splat(0)};
    for (int k = 0; k < 3; ++k) reaction[k] -= force[k];
    if (both) add_short(sums, slots.offset + W * slot, force);
  };
  overlap(slots.begin, slots.end, fetch, see, act);
}

// How a controller's motion within the frame depends on where it is at both ends of it.
struct Held { R *gradient; int64_t stride; V share, pace; };

// From the adjoint of the net forces to that of the state: what the slots add at their points is taken from
// `flow`. `both`: the other ends are points too, on which as much is pulled, and what they get is added to their
// `sums`; otherwise they are `held`. `weighs`: the work of the force on its adjoint is wanted too, in the seventh
// place.
template <bool both, bool weighs, class Law>
INLINE void pull_back(Law &law, const Slots &slots, const R *rows, const R *pulls, const V me[8], const V mine[4],
                      V flow[8], R *sums, const Held *held) {
  struct Seen { Between between; V pulled[3]; };
  const auto see = [&](int64_t slot) {
    Seen seen;
    V at[8], pulled[4];
    gather(rows, slots.offset + W * slot, at);
    seen.between = between(me, at);
    if (both) gather_short(pulls, slots.offset + W * slot, pulled);
    for (int k = 0; k < 3; ++k) seen.pulled[k] = both ? mine[k] - pulled[k] : mine[k];
    return seen;
  };
  const auto act = [&](int64_t slot, const Seen &seen) {
    const Edge e = edge(seen.between, law.rest(slot));
    const V *pulled = seen.pulled, tensionbar = along(pulled, e.d) * e.inverse;
    V lengthbar, ratebar;
    const V tension = law.pull_back(slot, e.length, e.rate, tensionbar, lengthbar, ratebar);
    // f = (T/l) d, l' = w·d/l: what each passes on to d and w, split into parts along d, `pulled` and w.
    const V scaled = tension * e.inverse, paced = ratebar * e.inverse;
    const V axial = (lengthbar - scaled * tensionbar - paced * e.rate) * e.inverse;
    V bar[8];
    bar[6] = bar[7] = splat(0);
    for (int k = 0; k < 3; ++k) {
      bar[k] = axial * e.d[k] + scaled * pulled[k] + paced * e.w[k];
      bar[3 + k] = paced * e.d[k];
      if (weighs) {
        flow[6] += scaled * e.d[k] * mine[k];
        if (both) bar[6] += scaled * e.d[k] * (pulled[k] - mine[k]);
      }
      if (!both && held->gradient) {
        R *gradient = held->gradient + held->stride * k + W * slot;
        accumulate(gradient, (1 - held->share) * bar[k] - held->pace * bar[3 + k]);
        accumulate(gradient + 3 * held->stride, held->share * bar[k] + held->pace * bar[3 + k]);
      }
    }
    for (int k = 0; k < 6; ++k) flow[k] -= bar[k];
    if (both) add(sums, slots.offset + W * slot, bar);
  };
  overlap(slots.begin, slots.end, see, act);
}
