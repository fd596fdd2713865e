// Forces on particles and springs, one step after the other, between calls of MuJoCo's mj_step.
//
// MuJoCo integrates, drags (joint damping) and holds the contacts with the ground; everything else is applied to its
// particles here: springs with dampers along them, hands, and the withheld effects. An array that is not given is an
// effect that is not there. Along springs, e is the strain and tensions are in N.
// References: Provot 1995 (springs); Ogden & Roxburgh 1999 (Mullins); Bouc 1967, Wen 1976; Simo & Hughes 1998 (Prony).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

extern "C" struct Problem {
  int32_t nodes, springs, bends, cells, grips, samples;
  void *model, *data;             // of MuJoCo
  double *position;               // qpos [nodes,3] m, from where each began
  double *velocity;               // qvel [nodes,3] m/s
  double *applied;                // qfrc_applied [nodes,3] N
  const double *start;            // [nodes,3] m
  const double *rest_place;       // [nodes,3] m
  const double *mass;             // [nodes] kg
  const int32_t *spring;          // [springs,2]
  const double *rest, *stiffness, *damping;  // [springs] m, N/m, N s/m
  const int32_t *grip_node;       // [grips]
  const double *anchor;           // [samples,grips,3] m, where each grip is pulled to
  const double *grip_stiff, *grip_damping;  // [grips] N/m, N s/m
  double anchor_rate;             // 1/s
  double ground;                  // m; NaN: none
  double gravity[3];
  // effects along springs; an array holds the tension [N] per unit of what follows
  const double *fung;             // (exp(rate e^2) - 1)/rate e
  const double *power;            // (|e|/scale)^exponent e
  const double *slack;            // -e in compression
  const double *prony;            // e - z of each of two branches
  const double *hysteresis;       // z - e, Bouc-Wen
  const double *mullins;          // -erf((peak - |e|)/scale) e
  const double *fibre;            // e
  const double *swelling;         // -1, growing until swelling_time
  double fung_rate, power_exponent, power_scale, prony_time[2], yield, sharpness, mullins_scale, swelling_time;
  // effects on particles and cells
  const int32_t *bend;            // [bends,3]
  const double *bend_weight;      // [bends,3] 1/m
  const double *bend_stiff;       // [bends] N m^2, of 1/2 k (|sum w x| - rest)^2
  const double *bend_rest;        // [bends]
  const int32_t *cell;            // [cells,4]
  const double *cell_volume, *cell_stiff;  // [cells] m^3, Pa
  const double *air;              // [nodes] N s^p/m^p
  const double *blown;            // [nodes] N s^2/m^2
  const double *stuck;            // [nodes] N at the peak of adhesion
  const double *tether;           // [nodes] kg/s^2
  double air_exponent, wind[3], gust, gust_rate, shear, adhesion_range;
  double tether_damping;          // s
  double stribeck, stribeck_speed;
  double slip_force, slip_rate;   // N, m/(N s)
  double contact_radius, contact_stiff;
  double magnet, magnet_exponent, magnet_place[3];
  double spin[3], spin_centre[3];
  double buoyancy, water_height;
  // what is remembered and told
  double *memory;                 // [springs,4] two branches, plastic strain, peak
  double *slip;                   // [grips,3] m
  double *touched, *met;          // [nodes] s in contact with the ground, with itself
};

namespace {

using Real = double;
using Step = void (*)(const void *, void *);

Real dot(const Real *a, const Real *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

class Applied {
 public:
  explicit Applied(const Problem &problem) : p(problem), x(3 * p.nodes) {}

  void at(Real time, Real dt) {
    for (int i = 0; i < 3 * p.nodes; ++i) { x[i] = p.start[i] + p.position[i]; p.applied[i] = 0; }
    for (int e = 0; e < p.springs; ++e) pull(e, time, dt);
    for (int b = 0; b < p.bends; ++b) bend(b);
    for (int c = 0; c < p.cells; ++c) swell(c);
    for (int g = 0; g < p.grips; ++g) hold(g, time, dt);
    for (int i = 0; i < p.nodes; ++i) surround(i, time, dt);
    if (p.contact_radius > 0) meet(dt);
  }

 private:
  const Problem &p;
  std::vector<Real> x;
  std::vector<int> near;
  int age = 0;

  void pull(int e, Real time, Real dt) {
    const int i = 3 * p.spring[2 * e], j = 3 * p.spring[2 * e + 1];
    const Real *v = p.velocity;
    Real way[3], speed[3];
    for (int k = 0; k < 3; ++k) { way[k] = x[j + k] - x[i + k]; speed[k] = v[j + k] - v[i + k]; }
    const Real length = std::sqrt(dot(way, way)) + 1e-12;
    const Real strain = length / p.rest[e] - 1, rate = dot(speed, way) / length / p.rest[e];
    Real tension = (p.stiffness[e] * strain + p.damping[e] * rate) * p.rest[e];
    tension += law(e, strain, rate, time, dt);
    for (int k = 0; k < 3; ++k) {
      const Real force = tension * way[k] / length;
      p.applied[i + k] += force;
      p.applied[j + k] -= force;
    }
  }

  Real law(int e, Real strain, Real rate, Real time, Real dt) {
    Real tension = 0, *memory = p.memory + 4 * e;
    const Real size = std::fabs(strain);
    if (p.fung) tension += p.fung[e] * std::expm1(std::min(p.fung_rate * strain * strain, 3.0)) / p.fung_rate * strain;
    if (p.power) tension += p.power[e] * std::pow(std::min(size / p.power_scale, 2.5), p.power_exponent) * strain;
    if (p.slack) tension -= p.slack[e] * std::min(strain, 0.0);
    if (p.prony) for (int b = 0; b < 2; ++b) {
      const Real keep = std::exp(-dt / p.prony_time[b]);
      memory[b] = memory[b] * keep + p.prony_time[b] * (1 - keep) * rate;
      tension += p.prony[e] * memory[b];
    }
    if (p.hysteresis) {
      Real &z = memory[2];
      const Real spent = z * rate > 0 ? std::pow(std::min(std::fabs(z) / p.yield, 3.0), p.sharpness) : 0;
      z += dt * rate * (1 - std::min(spent, 1.0));
      tension += p.hysteresis[e] * (z - strain);
    }
    if (p.mullins) {
      memory[3] = std::max(memory[3], size);
      tension -= p.mullins[e] * std::erf((memory[3] - size) / p.mullins_scale) * strain;
    }
    if (p.fibre) tension += p.fibre[e] * strain;
    if (p.swelling) tension -= p.swelling[e] * std::min(time / p.swelling_time, 1.0);
    return tension;
  }

  void bend(int b) {
    const int32_t *nodes = p.bend + 3 * b;
    const Real *w = p.bend_weight + 3 * b;
    Real curve[3] = {};
    for (int a = 0; a < 3; ++a) for (int k = 0; k < 3; ++k) curve[k] += w[a] * x[3 * nodes[a] + k];
    const Real size = std::max(std::sqrt(dot(curve, curve)), p.bend_rest[b] / 2 + 1e-12);
    const Real push = p.bend_stiff[b] * (1 - p.bend_rest[b] / size);
    for (int a = 0; a < 3; ++a) for (int k = 0; k < 3; ++k) p.applied[3 * nodes[a] + k] -= push * w[a] * curve[k];
  }

  void swell(int c) {
    const int32_t *nodes = p.cell + 4 * c;
    Real edge[3][3], slope[3][3];
    for (int a = 0; a < 3; ++a) for (int k = 0; k < 3; ++k) edge[a][k] = x[3 * nodes[a + 1] + k] - x[3 * nodes[0] + k];
    for (int a = 0; a < 3; ++a) {
      const Real *b = edge[(a + 1) % 3], *d = edge[(a + 2) % 3];
      for (int k = 0; k < 3; ++k) slope[a][k] = (b[(k + 1) % 3] * d[(k + 2) % 3] - b[(k + 2) % 3] * d[(k + 1) % 3]) / 6;
    }
    const Real push = -p.cell_stiff[c] * (dot(edge[0], slope[0]) / p.cell_volume[c] - 1);
    for (int a = 0; a < 3; ++a) for (int k = 0; k < 3; ++k) {
      p.applied[3 * nodes[a + 1] + k] += push * slope[a][k];
      p.applied[3 * nodes[0] + k] -= push * slope[a][k];
    }
  }

  void hold(int g, Real time, Real dt) {
    const int i = 3 * p.grip_node[g];
    const Real place = std::min(time * p.anchor_rate, p.samples - 1.001), share = place - (int)place;
    const Real *low = p.anchor + 3 * ((int64_t)place * p.grips + g), *high = low + 3 * p.grips;
    Real pull[3], *slip = p.slip + 3 * g;
    for (int k = 0; k < 3; ++k) {
      pull[k] = p.grip_stiff[g] * (low[k] + share * (high[k] - low[k]) + slip[k] - x[i + k]);
      const Real speed = (high[k] - low[k]) * p.anchor_rate;
      p.applied[i + k] += pull[k] + p.grip_damping[g] * (speed - p.velocity[i + k]);
    }
    if (p.slip_rate <= 0) return;
    const Real size = std::sqrt(dot(pull, pull)) + 1e-12;
    const Real move = std::min(p.slip_rate * dt, 0.5 / p.grip_stiff[g]) * std::max(size - p.slip_force, 0.0) / size;
    for (int k = 0; k < 3; ++k) slip[k] -= move * pull[k];
  }

  void surround(int i, Real time, Real dt) {
    const Real *at = x.data() + 3 * i, *v = p.velocity + 3 * i, m = p.mass[i];
    Real *f = p.applied + 3 * i;
    if (p.air) {
      const Real drag = p.air[i] * std::pow(std::sqrt(dot(v, v)) + 1e-9, p.air_exponent - 1);
      for (int k = 0; k < 3; ++k) f[k] -= drag * v[k];
    }
    if (p.blown) {
      const Real lull = 1 + p.gust * std::sin(6.283185307179586 * p.gust_rate * time);
      const Real high = std::pow(std::max(at[2], 0.01) / 0.3, p.shear);
      Real u[3];
      for (int k = 0; k < 3; ++k) u[k] = p.wind[k] * lull * high - v[k];
      const Real size = std::sqrt(dot(u, u));
      for (int k = 0; k < 3; ++k) f[k] += p.blown[i] * size * u[k];
    }
    if (p.magnet > 0) {
      Real way[3];
      for (int k = 0; k < 3; ++k) way[k] = p.magnet_place[k] - at[k];
      const Real r = std::sqrt(dot(way, way) + 0.0036);
      const Real draw = m * p.magnet * std::pow(0.1 / r, p.magnet_exponent) / r;
      for (int k = 0; k < 3; ++k) f[k] += draw * way[k];
    }
    turn(i, f, at, v);
    if (p.tether) for (int k = 0; k < 3; ++k) f[k] += p.tether[i] * (p.start[3 * i + k] - at[k] - p.tether_damping * v[k]);
    if (p.buoyancy > 0) {
      const Real under = std::clamp((p.water_height - at[2]) / 0.1, 0.0, 1.0);
      for (int k = 0; k < 3; ++k) f[k] -= m * p.buoyancy * under * p.gravity[k];
    }
    if (std::isfinite(p.ground)) touch(i, f, at, v, dt);
  }

  // Coriolis and centrifugal forces of a base that turns.
  void turn(int i, Real *f, const Real *at, const Real *v) const {
    const Real *w = p.spin, square = dot(w, w);
    if (square == 0) return;
    Real arm[3];
    for (int k = 0; k < 3; ++k) arm[k] = at[k] - p.spin_centre[k];
    const Real along = dot(w, arm);
    for (int k = 0; k < 3; ++k) {
      const int a = (k + 1) % 3, b = (k + 2) % 3;
      f[k] -= p.mass[i] * (2 * (w[a] * v[b] - w[b] * v[a]) + w[k] * along - square * arm[k]);
    }
  }

  void touch(int i, Real *f, const Real *at, const Real *v, Real dt) {
    const Real gap = at[2] - p.ground;
    if (gap < 0.001) p.touched[i] += dt;
    if (p.stuck) {
      const Real s = std::max(gap / p.adhesion_range, 0.0);
      if (s < 6) f[2] -= p.stuck[i] * s * std::exp(1 - s);
    }
    if (p.stribeck > 0 && gap < 0.002) {
      const Real speed = std::sqrt(v[0] * v[0] + v[1] * v[1]) + 1e-9, ratio = speed / p.stribeck_speed, m = p.mass[i];
      const Real most = p.stribeck * m * 9.81 * std::exp(-ratio * ratio), held = std::min(most, 0.3 * m * speed / dt);
      f[0] -= held * v[0] / speed;
      f[1] -= held * v[1] / speed;
    }
  }

  void meet(Real dt) {
    const Real reach = p.contact_radius, far = 1.6 * reach, apart = 2.2 * reach;
    if (age-- <= 0) {
      near.clear();
      for (int i = 0; i < p.nodes; ++i) for (int j = i + 1; j < p.nodes; ++j) {
        Real now = 0, rest = 0;
        for (int k = 0; k < 3; ++k) {
          const Real d = x[3 * i + k] - x[3 * j + k], r = p.rest_place[3 * i + k] - p.rest_place[3 * j + k];
          now += d * d;
          rest += r * r;
        }
        if (now < far * far && rest > apart * apart) { near.push_back(i); near.push_back(j); }
      }
      age = 8;
    }
    for (size_t c = 0; c < near.size(); c += 2) {
      const int i = near[c], j = near[c + 1];
      Real way[3], speed[3];
      for (int k = 0; k < 3; ++k) { way[k] = x[3 * j + k] - x[3 * i + k]; speed[k] = p.velocity[3 * j + k] - p.velocity[3 * i + k]; }
      const Real size = std::sqrt(dot(way, way)) + 1e-12;
      if (size >= reach) continue;
      p.met[i] += dt; p.met[j] += dt;
      const Real m = std::min(p.mass[i], p.mass[j]), close = dot(speed, way) / size;
      const Real push = std::max(p.contact_stiff * (reach - size) - 0.5 * std::sqrt(p.contact_stiff * m) * close, 0.0);
      for (int k = 0; k < 3; ++k) {
        p.applied[3 * j + k] += push * way[k] / size;
        p.applied[3 * i + k] -= push * way[k] / size;
      }
    }
  }
};

}  // namespace

// Steps of one frame, each of `dt` [s]; `step` is MuJoCo's.
extern "C" void advance(const Problem *problem, Step step, int32_t steps, double time, double dt) {
  Applied applied(*problem);
  for (int s = 0; s < steps; ++s) {
    applied.at(time + s * dt, dt);
    step(problem->model, problem->data);
  }
}
extern "C" int64_t problem_bytes() { return sizeof(Problem); }
