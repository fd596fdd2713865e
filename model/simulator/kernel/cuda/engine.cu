// One substep of semi-implicit Euler over a spring graph, and its adjoint, for CUDA.
//
// A thread is a point of an element of the batch: it gathers from its own springs (each spring has a slot at both of
// its ends), so nothing is scattered, nothing is atomic, and sums come out the same every time. Slots lie as a warp
// reads them: the k-th slots of 32 neighbouring points are neighbours. A point's row is
// [x y z vx vy vz approach kept]. A launch is a phase of a substep; the order of the stream is the barrier between.
//
// Before this text come `typedef … R;`, the number it computes with, and the macros GROUND, SPRINGS, CONTROLLERS,
// STENCILS, EDGES, SCENES and MEMORIES. The traced laws take the place of the line that says so.

typedef long long Long;
enum { WARP = 32, ROW = 8, SHORT = 4 };
#define DEVICE inline __device__
#define KERNEL extern "C" __global__ void
#define ROOM(count) ((count) > 0 ? (count) : 1)

// Square of the length below which an edge has no direction, and slip below which there is nothing to rub away.
#define SHORTEST_SQUARED R(1e-24)
#define SLOWEST R(1e-12)

// The values of one element of the batch after the other; a stride of zero where all share them.
struct Field { R *data; Long stride; };

// Slot k of point p is number (start[p / 32] + k) * 32 + p % 32, k < degree[p].
struct Slots { const int *start, *degree, *other; Long count; };

// Mirrored by `frame_type` in frame.py.
struct Frame {
  Long points, count, first, ring, keep;         // substeps of the frame; the first here; room for states; see memory
  double dt, interval;
  Slots springs, held, incidence;                // other: a row, a controller, a corner
  Long stencils[ROOM(STENCILS)], corner_row[ROOM(STENCILS)];
  const int *corners[ROOM(STENCILS)];            // [corner of the stencil][stencil]: rows of points
  Field corner_forces, corner_adjoints;          // [corner][4], [corner][8]
  Field rows;                                    // [ring][row][8]
  Field before, after;                           // controllers at the ends of the frame [.][3]
  Field inverse_mass, factor, restitution, friction, height;  // per point
  Field gravity;                                 // [3]
  Field edge[ROOM(EDGES)];                       // constants of the laws, per slot or stencil
  Field scene[ROOM(SCENES)];                     // the same of which the scene has one
  Field memory[ROOM(MEMORIES)];                  // [ring or 1][slot]: of every substep where `keep` is 1
  // the adjoint
  Field adjoint;                                 // [row][6]: of the state, in and out
  Field pulls[2];                                // [row][4]: of the net force
  Field memory_adjoint[ROOM(MEMORIES)];          // per slot, in and out
  Field edge_gradient[ROOM(EDGES)];              // per slot or stencil; null where not wanted
  Field scene_gradient[ROOM(SCENES)];            // per point or stencil; null where not wanted
  Field inverse_mass_gradient, factor_gradient, restitution_gradient, friction_gradient;  // per point or null
  Field gravity_gradient;                        // [row][3] or null
  Field held_gradient;                           // [6][slot] or null
};

DEVICE R *of(const Field &field, int element) {
  return field.data ? field.data + field.stride * element : nullptr;
}
DEVICE R *row_of(const Frame &f, int element, Long substep) {
  return of(f.rows, element) + ROW * f.points * (substep % f.ring);
}
DEVICE Long slot_of(const Slots &slots, int point, int k) {
  return Long(slots.start[point / WARP] + k) * WARP + point % WARP;
}

DEVICE R splat(R a) { return a; }
DEVICE R root(R a) { return sqrt(a); }
DEVICE R larger(R a, R b) { return a > b ? a : b; }
DEVICE R smaller(R a, R b) { return a < b ? a : b; }
DEVICE R magnitude(R a) { return a < 0 ? -a : a; }
DEVICE R exponential(R a) { return exp(a); }
DEVICE R logarithm(R a) { return log(a); }
DEVICE R sine(R a) { return sin(a); }
DEVICE R cosine(R a) { return cos(a); }
DEVICE R tangent(R a) { return tanh(a); }
DEVICE R power(R a, R b) { return pow(a, b); }

// Half a row in one load.
struct alignas(16) Four { R a, b, c, d; };
DEVICE Four four(const R *p) { return *reinterpret_cast<const Four *>(p); }
DEVICE void put(R *p, R a, R b, R c, R d) { *reinterpret_cast<Four *>(p) = Four{a, b, c, d}; }

DEVICE void read(const R *row, R out[6]) {
  const Four low = four(row), high = four(row + SHORT);
  out[0] = low.a; out[1] = low.b; out[2] = low.c; out[3] = low.d; out[4] = high.a; out[5] = high.b;
}
DEVICE void read_short(const R *row, R out[3]) {
  const Four low = four(row);
  out[0] = low.a; out[1] = low.b; out[2] = low.c;
}

struct Edge { R d[3], w[3], length, inverse, rate; };

// An edge without a direction pulls nowhere. It is taken to be at rest, where every law is finite.
DEVICE Edge edge(const R me[6], const R other[6], R rest) {
  Edge e;
  R square = 0, along = 0;
  for (int k = 0; k < 3; ++k) {
    e.d[k] = other[k] - me[k];
    e.w[k] = other[3 + k] - me[3 + k];
    square += e.d[k] * e.d[k];
    along += e.w[k] * e.d[k];
  }
  const bool directed = square > SHORTEST_SQUARED;
  e.length = directed ? root(square) : rest;
  e.inverse = directed ? 1 / e.length : R(0);
  e.rate = along * e.inverse;
  return e;
}

// THE LAWS

// How far into the frame a substep ends.
DEVICE R share_of(const Frame &f, int step) { return R(double(f.first + step + 1) / double(f.count)); }

// The place and velocity of a controller, which moves linearly within the frame.
DEVICE void hand(const Frame &f, int element, R share, int controller, R out[6]) {
  const R *before = of(f.before, element) + 3 * controller, *after = of(f.after, element) + 3 * controller;
  for (int k = 0; k < 3; ++k) {
    const R way = after[k] - before[k];
    out[k] = before[k] + way * share;
    out[3 + k] = way / R(f.interval);
  }
}

template <class Law, class Far>
DEVICE void pull(const Law &law, const Slots &slots, int point, const R me[6], R force[3], Far far) {
  const int degree = slots.degree[point];
  for (int k = 0; k < degree; ++k) {
    const Long slot = slot_of(slots, point, k);
    R other[6];
    far(slots.other[slot], other);
    const Edge e = edge(me, other, law.rest(slot));
    const R scaled = law.tension(slot, e.length, e.rate) * e.inverse;
    for (int i = 0; i < 3; ++i) force[i] += scaled * e.d[i];
  }
}

DEVICE void collect(const Frame &f, int element, int point, R force[3]) {
  const R *corners = of(f.corner_forces, element);
  for (int k = 0; k < f.incidence.degree[point]; ++k) {
    R one[3];
    read_short(corners + SHORT * Long(f.incidence.other[slot_of(f.incidence, point, k)]), one);
    for (int i = 0; i < 3; ++i) force[i] += one[i];
  }
}

template <class Law>
DEVICE void act(const Law &law, const Frame &f, int element, int step, int term, Long stencil) {
  enum { SIZE = Law::SIZE };
  const Long count = f.stencils[term];
  const R *rows = row_of(f, element, step);
  R *forces = of(f.corner_forces, element), at[SIZE][6], force[SIZE][3];
  for (int c = 0; c < SIZE; ++c) read(rows + ROW * Long(f.corners[term][c * count + stencil]), at[c]);
  law.forces(stencil, at, force);
  for (int c = 0; c < SIZE; ++c)
    put(forces + SHORT * (f.corner_row[term] + c * count + stencil), force[c][0], force[c][1], force[c][2], R(0));
}

KERNEL forward_corners(const Frame f, const int step) {
  const int thread = blockIdx.x * blockDim.x + threadIdx.x, element = blockIdx.y;
  on_stencil(f, element, step, thread,
             [&](const auto &law, int term, Long stencil) { act(law, f, element, step, term, stencil); });
}

KERNEL forward_points(const Frame f, const int step) {
  const int point = blockIdx.x * blockDim.x + threadIdx.x, element = blockIdx.y;
  if (point >= f.points) return;
  const R *rows = row_of(f, element, step);
  const R dt = R(f.dt), *gravity = of(f.gravity, element);
  R me[6], out[8], force[3] = {0, 0, 0};
  read(rows + ROW * Long(point), me);
  if (SPRINGS)
    pull(Springs(f, element, step), f.springs, point, me, force,
         [&](int row, R other[6]) { read(rows + ROW * Long(row), other); });
  if (CONTROLLERS) {
    const R share = share_of(f, step);
    pull(Controllers(f, element, step), f.held, point, me, force,
         [&](int controller, R other[6]) { hand(f, element, share, controller, other); });
  }
  if (STENCILS) collect(f, element, point, force);
  const R mobility = of(f.inverse_mass, element)[point], factor = of(f.factor, element)[point];
  for (int k = 0; k < 3; ++k) out[3 + k] = (me[3 + k] + dt * (force[k] * mobility + gravity[k])) * factor;
  out[6] = out[7] = 0;
  if (GROUND) {
    const R mu = of(f.friction, element)[point], e = of(f.restitution, element)[point];
    const bool meets = (me[2] + dt * out[5] < of(f.height, element)[point]) && (out[5] < 0);
    const R approach = meets ? -out[5] : R(0);
    const R slip = larger(root(out[3] * out[3] + out[4] * out[4]), SLOWEST);
    const R kept = meets ? larger(1 - mu * (1 + e) * approach / slip, R(0)) : R(1);
    out[3] *= kept;
    out[4] *= kept;
    out[5] = meets ? e * approach : out[5];
    out[6] = approach;
    out[7] = kept;
  }
  for (int k = 0; k < 3; ++k) out[k] = me[k] + dt * out[3 + k];
  R *to = row_of(f, element, Long(step) + 1) + ROW * Long(point);
  put(to, out[0], out[1], out[2], out[3]);
  put(to + SHORT, out[4], out[5], out[6], out[7]);
}

// From the adjoint of the state after a substep: that of the net force, for the neighbours to see, and the part of
// that of the state before it which needs no neighbour.
DEVICE void local(const Frame &f, int element, int point, const R *after, const R xbar[3], R vbar[3], R *pulls) {
  const R dt = R(f.dt), mobility = of(f.inverse_mass, element)[point], factor = of(f.factor, element)[point];
  const Four low = four(after + ROW * Long(point)), high = four(after + ROW * Long(point) + SHORT);
  R u[3] = {low.d, high.a, high.b}, ubar[3];
  for (int k = 0; k < 3; ++k) ubar[k] = vbar[k] + dt * xbar[k];
  if (GROUND) {
    const R mu = of(f.friction, element)[point], e = of(f.restitution, element)[point];
    const R approach = high.c, kept = high.d;
    const bool meets = approach > 0, slides = meets && kept > 0;
    u[0] = slides ? u[0] / kept : u[0];
    u[1] = slides ? u[1] / kept : u[1];
    u[2] = meets ? -approach : u[2];
    const R slip = larger(root(u[0] * u[0] + u[1] * u[1]), SLOWEST);
    const R keptbar = slides ? ubar[0] * u[0] + ubar[1] * u[1] : R(0);
    const R ratio = slides ? approach / slip : R(0);
    const R slipbar = slides ? keptbar * mu * (1 + e) * ratio / slip : R(0);
    if (R *gradient = of(f.restitution_gradient, element))
      gradient[point] += (meets ? ubar[2] * approach : R(0)) - keptbar * mu * ratio;
    if (R *gradient = of(f.friction_gradient, element)) gradient[point] -= keptbar * (1 + e) * ratio;
    const R approachbar = e * ubar[2] - (slides ? keptbar * mu * (1 + e) / slip : R(0));
    const R along = slides ? slipbar / slip : R(0), keeps = meets ? kept : R(1);
    ubar[0] = keeps * ubar[0] + along * u[0];
    ubar[1] = keeps * ubar[1] + along * u[1];
    ubar[2] = meets ? -approachbar : ubar[2];
  }
  if (R *gradient = of(f.factor_gradient, element))
    gradient[point] += (ubar[0] * u[0] + ubar[1] * u[1] + ubar[2] * u[2]) / factor;
  R *gravity = of(f.gravity_gradient, element);
  for (int k = 0; k < 3; ++k) {
    vbar[k] = ubar[k] * factor;
    if (gravity) gravity[3 * Long(point) + k] += dt * vbar[k];
  }
  const R weight = dt * mobility;
  put(pulls + SHORT * Long(point), vbar[0] * weight, vbar[1] * weight, vbar[2] * weight, R(0));
}

// `Far` reads the other end and the adjoint of the force on it, of a controller none; `give` takes the adjoints of
// the edge's direction and relative velocity, as they are at a controller.
template <class Law, class Far, class Give>
DEVICE void pull_back(Law &law, const Slots &slots, int point, const R me[6], const R mine[3], R force[3], R bar[6],
                      Far far, Give give) {
  const int degree = slots.degree[point];
  for (int k = 0; k < degree; ++k) {
    const Long slot = slot_of(slots, point, k);
    R other[6], pulled[3] = {0, 0, 0}, lengthbar, ratebar, along = 0;
    far(slots.other[slot], other, pulled);
    const Edge e = edge(me, other, law.rest(slot));
    for (int i = 0; i < 3; ++i) {
      pulled[i] = mine[i] - pulled[i];
      along += pulled[i] * e.d[i];
    }
    const R tensionbar = along * e.inverse;
    const R tension = law.pull_back(slot, e.length, e.rate, tensionbar, lengthbar, ratebar);
    // f = (T/l) d, l' = w·d/l: what each passes on to d and w, split into parts along d, `pulled` and w.
    const R scaled = tension * e.inverse, paced = ratebar * e.inverse;
    const R axial = (lengthbar - scaled * tensionbar - paced * e.rate) * e.inverse;
    for (int i = 0; i < 3; ++i) {
      const R dbar = axial * e.d[i] + scaled * pulled[i] + paced * e.w[i], wbar = paced * e.d[i];
      force[i] += scaled * e.d[i];
      bar[i] -= dbar;
      bar[3 + i] -= wbar;
      give(slot, i, dbar, wbar);
    }
  }
}

KERNEL backward_end(const Frame f, const int step) {
  const int point = blockIdx.x * blockDim.x + threadIdx.x, element = blockIdx.y;
  if (point >= f.points) return;
  R *bar = of(f.adjoint, element) + 6 * Long(point);
  local(f, element, point, row_of(f, element, step), bar, bar + 3, of(f.pulls[step & 1], element));
}

template <class Law>
DEVICE void act_back(const Law &law, const Frame &f, int element, int step, int term, Long stencil) {
  enum { SIZE = Law::SIZE };
  const Long count = f.stencils[term];
  const R *rows = row_of(f, element, step), *pulls = of(f.pulls[(step + 1) & 1], element);
  R *forces = of(f.corner_forces, element), *adjoints = of(f.corner_adjoints, element);
  R at[SIZE][6], pulled[SIZE][3], force[SIZE][3], bar[SIZE][6];
  for (int c = 0; c < SIZE; ++c) {
    const Long row = f.corners[term][c * count + stencil];
    read(rows + ROW * row, at[c]);
    read_short(pulls + SHORT * row, pulled[c]);
  }
  law.pull_back(stencil, at, pulled, force, bar);
  for (int c = 0; c < SIZE; ++c) {
    const Long corner = f.corner_row[term] + c * count + stencil;
    put(forces + SHORT * corner, force[c][0], force[c][1], force[c][2], R(0));
    put(adjoints + ROW * corner, bar[c][0], bar[c][1], bar[c][2], bar[c][3]);
    put(adjoints + ROW * corner + SHORT, bar[c][4], bar[c][5], R(0), R(0));
  }
}

KERNEL backward_corners(const Frame f, const int step) {
  const int thread = blockIdx.x * blockDim.x + threadIdx.x, element = blockIdx.y;
  on_stencil(f, element, step, thread,
             [&](const auto &law, int term, Long stencil) { act_back(law, f, element, step, term, stencil); });
}

KERNEL backward_points(const Frame f, const int step) {
  const int point = blockIdx.x * blockDim.x + threadIdx.x, element = blockIdx.y;
  if (point >= f.points) return;
  const R *rows = row_of(f, element, step), *pulls = of(f.pulls[(step + 1) & 1], element);
  R *kept = of(f.adjoint, element) + 6 * Long(point);
  R me[6], mine[3], bar[6], force[3] = {0, 0, 0};
  read(rows + ROW * Long(point), me);
  read_short(pulls + SHORT * Long(point), mine);
  for (int k = 0; k < 6; ++k) bar[k] = kept[k];
  if (SPRINGS) {
    Springs springs(f, element, step);
    pull_back(springs, f.springs, point, me, mine, force, bar,
              [&](int row, R other[6], R pulled[3]) {
                read(rows + ROW * Long(row), other);
                read_short(pulls + SHORT * Long(row), pulled);
              },
              [](Long, int, R, R) {});
    springs.finish(f, element, point);
  }
  if (CONTROLLERS) {
    Controllers controllers(f, element, step);
    const R share = share_of(f, step), pace = R(1 / f.interval);
    R *held = of(f.held_gradient, element);
    pull_back(controllers, f.held, point, me, mine, force, bar,
              [&](int controller, R other[6], R[3]) { hand(f, element, share, controller, other); },
              [&](Long slot, int axis, R dbar, R wbar) {
                if (!held) return;
                held[f.held.count * axis + slot] += (1 - share) * dbar - pace * wbar;
                held[f.held.count * (3 + axis) + slot] += share * dbar + pace * wbar;
              });
    controllers.finish(f, element, point);
  }
  if (STENCILS) {
    collect(f, element, point, force);
    const R *corners = of(f.corner_adjoints, element);
    for (int k = 0; k < f.incidence.degree[point]; ++k) {
      R one[6];
      read(corners + ROW * Long(f.incidence.other[slot_of(f.incidence, point, k)]), one);
      for (int i = 0; i < 6; ++i) bar[i] += one[i];
    }
  }
  if (R *gradient = of(f.inverse_mass_gradient, element))
    gradient[point] += (mine[0] * force[0] + mine[1] * force[1] + mine[2] * force[2]) /
                       of(f.inverse_mass, element)[point];
  if (step) local(f, element, point, rows, bar, bar + 3, of(f.pulls[step & 1], element));
  for (int k = 0; k < 6; ++k) kept[k] = bar[k];
}
