// Finite elements in motion: segments, triangles or tetrahedra, one constitutive law on the deformation gradient.
//
// Corotational linear elasticity (material frame: strain e = sym(R^T F) - I), Kelvin-Voigt damping, velocity Verlet
// (kick, drift, kick), ground as a damped penalty with a Coulomb clamp, hands as springs to moving anchors.
// Effects act through the same element loop or node loop; every amplitude is zero unless asked for.
// References: Mueller et al. 2016 (rotation extraction); Bergou et al. 2006 (quadratic bending);
// Ogden & Roxburgh 1999 (Mullins); Fung 1967; Bouc 1967, Wen 1976; Simo & Hughes 1998 (Prony, algorithm).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

namespace {

using Real = double;
constexpr Real PI = 3.14159265358979323846;
enum Law { STIFFER, SLACK, PRONY, HYSTERESIS, MULLINS, FIBRE, BULK, SWELLING, LAWS };  // columns of `field`

}  // namespace

extern "C" struct Problem {
  int32_t nodes, dim, elements, stencils, grips, frames, samples, faces;
  const double *rest;           // [nodes,3] m
  const double *start;          // [nodes,3] m
  const double *mass;           // [nodes] kg
  const int32_t *corner;        // [elements,dim+1]
  const double *mu, *lambda;    // [elements] Pa (N/m in 2D, N in 1D)
  const double *eta;            // [elements] Pa s
  const int32_t *stencil;       // [stencils,4]
  const double *stencil_weight; // [stencils,4]
  const double *stencil_stiff;  // [stencils] of 1/2 k (|sum w x| - rest)^2
  const double *stencil_rest;   // [stencils]
  const int32_t *grip_node;     // [grips]
  const double *anchor;         // [samples,grips,3] m, where each grip is pulled to
  const double *grip_stiff;     // [grips] N/m
  const int32_t *face;          // [faces,3]
  const double *node_area;      // [nodes] m^2, for a rope
  const double *times;          // [frames] s
  const double *field;          // [elements,LAWS] 0..1, where each of the element effects acts
  const double *node_field;     // [nodes] 0..1, where the node effects act
  const double *fibre;          // [elements,dim] unit direction in the rest frame
  double anchor_rate;           // 1/s
  double step;                  // s, largest allowed
  double gravity[3];
  double drag_rate;             // 1/s
  double ground;                // m; NaN: none
  double friction, restitution;
  // effects
  double fung, fung_rate;                       // T += 2 mu fung (exp(rate |e|^2) - 1)/rate e
  double power, power_exponent, power_scale;    // T += 2 mu power (|e|/scale)^exponent e
  double slack;                                 // share of stiffness lost in compression
  double prony[2], prony_time[2];               // shares and times [s]
  double hysteresis, hysteresis_yield, hysteresis_sharpness;  // Bouc-Wen share, strain, exponent
  double mullins, mullins_scale;                // share lost, strain scale
  double fibre_stiff;                           // times 2 mu
  double bulk;                                  // times lambda + 2 mu
  double swelling, swelling_time;               // thermal strain at the end, s
  double air, air_exponent, air_reference;      // kg/m^3-like: f = air A |u|^(p) with u/ref
  double wind[3], gust, gust_rate, shear, shear_height;
  double stribeck, stribeck_speed;              // extra static friction
  double adhesion, adhesion_range;              // N/m^2 at its peak, m
  double slip_force, slip_rate;                 // N, m/(N s)
  double contact_radius, contact_stiff;         // m, N/m
  double magnet, magnet_exponent, magnet_soft, magnet_place[3];  // m/s^2 at 0.1 m
  double spin[3], spin_centre[3];               // rad/s
  double tether, tether_damping;                // 1/s^2, 1/s: nodes of the field stick to where they began
  double buoyancy, water_height, water_band;    // share of weight
  // results
  double *out;                  // [frames,nodes,3]
  double *energy;               // [frames,4] kinetic, elastic, gravity, grip work
  double *touched;              // [nodes] seconds in contact with the ground
  double *met;                  // [nodes] seconds in contact with itself
  double *slipped;              // [grips] m
};

namespace {

// Eight elements at a time.
constexpr int LANES = 8;
typedef float Lanes __attribute__((vector_size(4 * LANES)));

template <class F> Lanes each(Lanes x, F f) {
  Lanes r;
  for (int l = 0; l < LANES; ++l) r[l] = f(x[l]);
  return r;
}
Lanes all(float x) { return Lanes{} + x; }
Lanes root(Lanes x) { return each(x, [](float v) { return std::sqrt(v); }); }
Lanes larger(Lanes x, float y) { return each(x, [y](float v) { return v > y ? v : y; }); }

// A few Newton steps towards the rotation [3,3] nearest to F, from the quaternion of the time before.
void polar3(const Lanes *F, Lanes *q, Lanes *R, int turns) {
  for (int turn = 0; turn <= turns; ++turn) {
    const Lanes w = q[0], x = q[1], y = q[2], z = q[3];
    R[0] = 1 - 2 * (y * y + z * z); R[1] = 2 * (x * y - w * z); R[2] = 2 * (x * z + w * y);
    R[3] = 2 * (x * y + w * z); R[4] = 1 - 2 * (x * x + z * z); R[5] = 2 * (y * z - w * x);
    R[6] = 2 * (x * z - w * y); R[7] = 2 * (y * z + w * x); R[8] = 1 - 2 * (x * x + y * y);
    if (turn == turns) break;
    Lanes a[3] = {}, trace = {};
    for (int c = 0; c < 3; ++c) {
      a[0] += R[3 + c] * F[6 + c] - R[6 + c] * F[3 + c];
      a[1] += R[6 + c] * F[c] - R[c] * F[6 + c];
      a[2] += R[c] * F[3 + c] - R[3 + c] * F[c];
      trace += R[c] * F[c] + R[3 + c] * F[3 + c] + R[6 + c] * F[6 + c];
    }
    // Half of the angle: the second derivative of tr(R^T F) is about two thirds of the trace.
    const Lanes half = 0.75f / larger(each(trace, [](float v) { return std::fabs(v); }), 1e-3f);
    const Lanes u = a[0] * half, s = a[1] * half, t = a[2] * half;
    const Lanes size = 1 / root((1 + u * u + s * s + t * t) * (w * w + x * x + y * y + z * z));
    q[0] = (w - u * x - s * y - t * z) * size;
    q[1] = (x + u * w + s * z - t * y) * size;
    q[2] = (y - u * z + s * w + t * x) * size;
    q[3] = (z + u * y - s * x + t * w) * size;
  }
}

// R [3,D] of the polar decomposition F = R U.
template <int D> void polar(const Lanes *F, Lanes *quat, Lanes *R, int turns) {
  if constexpr (D == 3) {
    polar3(F, quat, R, turns);
  } else if constexpr (D == 1) {
    const Lanes size = 1 / root(F[0] * F[0] + F[1] * F[1] + F[2] * F[2] + 1e-20f);
    for (int k = 0; k < 3; ++k) R[k] = F[k] * size;
  } else {
    Lanes a = {}, b = {}, c = {};
    for (int k = 0; k < 3; ++k) { a += F[2 * k] * F[2 * k]; b += F[2 * k] * F[2 * k + 1]; c += F[2 * k + 1] * F[2 * k + 1]; }
    const Lanes s = root(larger(a * c - b * b, 1e-8f)), t = 1 / root(a + c + 2 * s);
    const Lanes ua = (a + s) * t, ub = b * t, uc = (c + s) * t, det = 1 / (ua * uc - ub * ub);
    for (int k = 0; k < 3; ++k) {
      R[2 * k] = (F[2 * k] * uc - F[2 * k + 1] * ub) * det;
      R[2 * k + 1] = (F[2 * k + 1] * ua - F[2 * k] * ub) * det;
    }
  }
}

// Add -factor * (compressive part of e) to T, by Jacobi rotations of e [D,D], one lane at a time.
template <int D> void slacken(const Lanes *e, Lanes factor, Lanes *T) {
  for (int lane = 0; lane < LANES; ++lane) {
    float a[D * D], v[D * D];
    for (int i = 0; i < D * D; ++i) { a[i] = e[i][lane]; v[i] = i % (D + 1) == 0; }
    for (int sweep = 0; sweep < (D == 3 ? 4 : 1) && D > 1; ++sweep)
      for (int p = 0; p < D; ++p) for (int q = p + 1; q < D; ++q) {
        if (std::fabs(a[p * D + q]) < 1e-8f) continue;
        const float th = (a[q * D + q] - a[p * D + p]) / (2 * a[p * D + q]);
        const float t = (th >= 0 ? 1 : -1) / (std::fabs(th) + std::sqrt(th * th + 1));
        const float c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < D; ++k) { const float x = a[k * D + p], y = a[k * D + q]; a[k * D + p] = c * x - s * y; a[k * D + q] = s * x + c * y; }
        for (int k = 0; k < D; ++k) { const float x = a[p * D + k], y = a[q * D + k]; a[p * D + k] = c * x - s * y; a[q * D + k] = s * x + c * y; }
        for (int k = 0; k < D; ++k) { const float x = v[k * D + p], y = v[k * D + q]; v[k * D + p] = c * x - s * y; v[k * D + q] = s * x + c * y; }
      }
    for (int k = 0; k < D; ++k) {
      const float value = a[k * D + k];
      if (value >= 0) continue;
      for (int i = 0; i < D; ++i) for (int j = 0; j < D; ++j) T[i * D + j][lane] -= factor[lane] * value * v[i * D + k] * v[j * D + k];
    }
  }
}

// Eight elements: their constants and what they remember.
template <int D> struct Group {
  int32_t corner[LANES][D + 1];
  Lanes gradient[D][D];  // of the shape functions of corners 1..D, in the element's own rest frame
  Lanes volume, mu, lambda, eta, where[LAWS], fibre[D];
  Lanes q[2][D * D], z[D * D], peak, quat[4];
};

template <int D> class Body {
 public:
  explicit Body(const Problem &problem) : p(problem), groups((p.elements + LANES - 1) / LANES) {
    std::memset(static_cast<void *>(groups.data()), 0, groups.size() * sizeof(Group<D>));
    for (size_t e = 0; e < groups.size() * LANES; ++e) prepare(e);
  }

  // Forces of all elements at positions x and velocities v; memory advances by dt. Returns the elastic energy.
  Real forces(const Real *x, const Real *v, Real dt, Real time, Real *f) {
    const float strain = p.swelling_time > 0 ? p.swelling * std::min(time / p.swelling_time, 1.0) : 0;
    for (int b = 0; b < 2; ++b) decay[b] = p.prony_time[b] > 0 ? std::exp(-dt / p.prony_time[b]) : 0;
    Real energy = 0;
    for (auto &group : groups) energy += elements(group, x, v, dt, strain, f);
    turns = 3;
    return energy;
  }

 private:
  const Problem &p;
  std::vector<Group<D>> groups;
  float decay[2] = {};
  int turns = 60;

  void prepare(size_t slot) {
    Group<D> &group = groups[slot / LANES];
    const int lane = slot % LANES, e = std::min<int>(slot, p.elements - 1);
    const int32_t *c = p.corner + e * (D + 1);
    Real edge[3][3] = {};
    for (int a = 0; a < D; ++a) for (int k = 0; k < 3; ++k) edge[a][k] = p.rest[3 * c[a + 1] + k] - p.rest[3 * c[0] + k];
    Real frame[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int a = 0; a < D && D < 3; ++a) {  // Gram-Schmidt of the edges spans the element
      for (int k = 0; k < 3; ++k) frame[a][k] = edge[a][k];
      for (int b = 0; b < a; ++b) {
        Real along = 0;
        for (int k = 0; k < 3; ++k) along += frame[a][k] * frame[b][k];
        for (int k = 0; k < 3; ++k) frame[a][k] -= along * frame[b][k];
      }
      const Real size = std::sqrt(frame[a][0] * frame[a][0] + frame[a][1] * frame[a][1] + frame[a][2] * frame[a][2]);
      for (int k = 0; k < 3; ++k) frame[a][k] /= size;
    }
    Real m[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, det = 0;
    for (int i = 0; i < D; ++i) for (int a = 0; a < D; ++a) {
      m[i][a] = 0;
      for (int k = 0; k < 3; ++k) m[i][a] += frame[i][k] * edge[a][k];
    }
    for (int k = 0; k < 3; ++k) det += m[0][k] * (m[1][(k + 1) % 3] * m[2][(k + 2) % 3] - m[1][(k + 2) % 3] * m[2][(k + 1) % 3]);
    for (int i = 0; i < D; ++i) for (int a = 0; a < D; ++a)
      group.gradient[a][i][lane] = (m[(i + 1) % 3][(a + 1) % 3] * m[(i + 2) % 3][(a + 2) % 3] - m[(i + 1) % 3][(a + 2) % 3] * m[(i + 2) % 3][(a + 1) % 3]) / det;
    const bool real = slot < (size_t)p.elements;  // the rest fill the last group and weigh nothing
    group.volume[lane] = real ? std::fabs(det) / (D == 3 ? 6 : D == 2 ? 2 : 1) : 0;
    group.mu[lane] = p.mu[e]; group.lambda[lane] = p.lambda[e]; group.eta[lane] = p.eta[e];
    for (int law = 0; law < LAWS; ++law) group.where[law][lane] = p.field[e * LAWS + law];
    for (int j = 0; j < D; ++j) group.fibre[j][lane] = p.fibre[e * D + j];
    for (int a = 0; a <= D; ++a) group.corner[lane][a] = c[a];
    group.quat[0][lane] = 1;
  }

  Real elements(Group<D> &own, const Real *x, const Real *v, Real dt, float swollen, Real *f) {
    Lanes F[3 * D] = {}, G[3 * D] = {}, R[3 * D], T[D * D], strain[D * D], rate[D * D], S[D * D];
    for (int a = 0; a < D; ++a) for (int k = 0; k < 3; ++k) {
      Lanes d, u;
      for (int l = 0; l < LANES; ++l) {
        const int i = 3 * own.corner[l][a + 1] + k, o = 3 * own.corner[l][0] + k;
        d[l] = x[i] - x[o]; u[l] = v[i] - v[o];
      }
      for (int j = 0; j < D; ++j) { F[k * D + j] += d * own.gradient[a][j]; G[k * D + j] += u * own.gradient[a][j]; }
    }
    polar<D>(F, own.quat, R, turns);
    Lanes trace = {}, size2 = {};
    for (int i = 0; i < D; ++i) for (int j = i; j < D; ++j) {
      Lanes s = {}, r = {};
      for (int k = 0; k < 3; ++k) {
        s += R[k * D + i] * F[k * D + j] + R[k * D + j] * F[k * D + i];
        r += F[k * D + i] * G[k * D + j] + F[k * D + j] * G[k * D + i];
      }
      strain[i * D + j] = strain[j * D + i] = i == j ? s * 0.5f - 1 - swollen * own.where[SWELLING] : s * 0.5f;
      rate[i * D + j] = rate[j * D + i] = r * 0.5f;
    }
    for (int i = 0; i < D; ++i) trace += strain[i * D + i];
    for (int i = 0; i < D * D; ++i) size2 += strain[i] * strain[i];
    stress(own, F, strain, rate, trace, size2, dt, T, S);
    Lanes P[3 * D];
    for (int k = 0; k < 3; ++k) for (int j = 0; j < D; ++j) {
      Lanes s = {};
      for (int i = 0; i < D; ++i) s += R[k * D + i] * T[i * D + j] + F[k * D + i] * S[i * D + j];
      P[k * D + j] = s;
    }
    if (D == 3 && p.bulk > 0) add_bulk(F, own.where[BULK] * (float)p.bulk * (own.lambda + 2 * own.mu), P);
    for (int k = 0; k < 3; ++k) {
      Lanes sum = {};
      for (int a = 0; a < D; ++a) {
        Lanes s = {};
        for (int j = 0; j < D; ++j) s += P[k * D + j] * own.gradient[a][j];
        s *= own.volume;
        sum += s;
        for (int l = 0; l < LANES; ++l) f[3 * own.corner[l][a + 1] + k] -= s[l];
      }
      for (int l = 0; l < LANES; ++l) f[3 * own.corner[l][0] + k] += sum[l];
    }
    const Lanes energy = own.volume * (own.mu * size2 + own.lambda * trace * trace * 0.5f);
    Real total = 0;
    for (int l = 0; l < LANES; ++l) total += energy[l];
    return total;
  }

  // T in the frame that turns with the element, S (second Piola-Kirchhoff) in the rest frame.
  void stress(Group<D> &own, const Lanes *F, const Lanes *strain, const Lanes *rate, Lanes trace, Lanes size2, Real dt, Lanes *T, Lanes *S) const {
    const Lanes size = root(size2), twice = 2 * own.mu;
    Lanes stiff = twice, share = all(1);
    if (p.fung > 0) {
      const float r = p.fung_rate, top = p.fung / p.fung_rate;
      stiff += twice * own.where[STIFFER] * each(size2, [=](float v) { return top * (std::exp(std::min(r * v, 3.0f)) - 1); });
    }
    if (p.power > 0) {
      const float scale = p.power_scale, exponent = p.power_exponent, top = p.power;
      stiff += twice * own.where[STIFFER] * each(size, [=](float v) { return top * std::pow(std::min(v / scale, 2.5f), exponent); });
    }
    if (p.mullins > 0) {
      for (int l = 0; l < LANES; ++l) own.peak[l] = std::max(own.peak[l], size[l]);
      const float scale = p.mullins_scale, top = p.mullins;
      share -= own.where[MULLINS] * each(own.peak - size, [=](float v) { return top * std::erf(v / scale); });
    }
    if (p.hysteresis > 0) share *= 1 - own.where[HYSTERESIS] * (float)p.hysteresis;
    for (int i = 0; i < D * D; ++i) T[i] = share * stiff * strain[i];
    for (int i = 0; i < D; ++i) T[i * D + i] += share * own.lambda * trace;
    if (p.slack > 0) slacken<D>(strain, own.where[SLACK] * (float)p.slack * twice, T);
    for (int i = 0; i < D * D; ++i) S[i] = own.eta * rate[i];
    if (p.hysteresis > 0) bouc_wen(own, rate, dt, S);
    for (int b = 0; b < 2; ++b) if (p.prony[b] > 0) {
      const Lanes grow = twice * own.where[PRONY] * (float)(p.prony[b] * p.prony_time[b] * (1 - decay[b]));
      for (int i = 0; i < D * D; ++i) { own.q[b][i] = own.q[b][i] * decay[b] + grow * rate[i]; S[i] += own.q[b][i]; }
    }
    if (p.fibre_stiff > 0) {
      Lanes along = all(1e-12f);
      for (int k = 0; k < 3; ++k) { Lanes s = {}; for (int j = 0; j < D; ++j) s += F[k * D + j] * own.fibre[j]; along += s * s; }
      along = root(along);
      const Lanes pull = twice * own.where[FIBRE] * (float)p.fibre_stiff * (along - 1) / along;
      for (int i = 0; i < D; ++i) for (int j = 0; j < D; ++j) S[i * D + j] += pull * own.fibre[i] * own.fibre[j];
    }
  }

  static void add_bulk(const Lanes *F, Lanes stiff, Lanes *P) {
    Lanes cof[9];
    for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j)
      cof[3 * i + j] = F[3 * ((i + 1) % 3) + (j + 1) % 3] * F[3 * ((i + 2) % 3) + (j + 2) % 3] - F[3 * ((i + 1) % 3) + (j + 2) % 3] * F[3 * ((i + 2) % 3) + (j + 1) % 3];
    const Lanes J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
    for (int i = 0; i < 9; ++i) P[i] += stiff * (J - 1) * cof[i];
  }

  void bouc_wen(Group<D> &own, const Lanes *rate, Real dt, Lanes *S) const {
    const float yield = p.hysteresis_yield, sharp = p.hysteresis_sharpness, most = 0.5 / dt, step = dt, part = p.hysteresis;
    Lanes inner = {}, size2 = all(1e-14f), trace = {}, limit;
    for (int i = 0; i < D * D; ++i) { inner += own.z[i] * rate[i]; size2 += own.z[i] * own.z[i]; }
    for (int l = 0; l < LANES; ++l)
      limit[l] = inner[l] > 0 ? std::min(std::pow(std::sqrt(size2[l]) / yield, sharp) * inner[l] / size2[l], most) : 0;
    for (int i = 0; i < D * D; ++i) own.z[i] += step * (rate[i] - limit * own.z[i]);
    for (int i = 0; i < D; ++i) trace += own.z[i * D + i];
    for (int i = 0; i < D * D; ++i) S[i] += own.where[HYSTERESIS] * part * 2 * own.mu * own.z[i];
    for (int i = 0; i < D; ++i) S[i * D + i] += own.where[HYSTERESIS] * part * own.lambda * trace;
  }
};

class Surroundings {
 public:
  explicit Surroundings(const Problem &problem) : p(problem), slip(3 * p.grips, 0.0) {}
  Real work = 0;

  void forces(const Real *x, const Real *v, Real dt, Real time, Real *f) {
    for (int i = 0; i < p.nodes; ++i) fields(i, x + 3 * i, v + 3 * i, f + 3 * i, time);
    bending(x, f);
    air(x, v, time, f);
    grips(x, v, dt, time, f);
    if (p.contact_radius > 0) meet(x, v, dt, f);
    if (!std::isnan(p.ground)) for (int i = 0; i < p.nodes; ++i) ground(i, x + 3 * i, v + 3 * i, dt, f + 3 * i);
  }

 private:
  const Problem &p;
  std::vector<Real> slip;
  std::vector<int> pairs;
  int age = 0;

  void fields(int i, const Real *x, const Real *v, Real *f, Real) const {
    const Real m = p.mass[i], here = p.node_field[i];
    for (int k = 0; k < 3; ++k) f[k] += m * (p.gravity[k] - p.drag_rate * v[k]);
    if (p.magnet != 0) {
      Real d[3], r2 = p.magnet_soft * p.magnet_soft;
      for (int k = 0; k < 3; ++k) { d[k] = p.magnet_place[k] - x[k]; r2 += d[k] * d[k]; }
      const Real r = std::sqrt(r2), pull = m * p.magnet * std::pow(0.1 / r, p.magnet_exponent) / r;
      for (int k = 0; k < 3; ++k) f[k] += pull * d[k];
    }
    if (p.spin[0] != 0 || p.spin[1] != 0 || p.spin[2] != 0) {
      const Real *w = p.spin;
      const Real r[3] = {x[0] - p.spin_centre[0], x[1] - p.spin_centre[1], x[2] - p.spin_centre[2]};
      Real wv[3], wr[3], wwr[3];
      cross(w, v, wv); cross(w, r, wr); cross(w, wr, wwr);
      for (int k = 0; k < 3; ++k) f[k] -= m * (2 * wv[k] + wwr[k]);
    }
    if (p.tether > 0) for (int k = 0; k < 3; ++k) f[k] += m * here * (p.tether * (p.start[3 * i + k] - x[k]) - p.tether_damping * v[k]);
    if (p.buoyancy != 0) {
      const Real depth = std::min(std::max((p.water_height - x[2]) / p.water_band, 0.0), 1.0);
      for (int k = 0; k < 3; ++k) f[k] -= m * p.gravity[k] * p.buoyancy * depth;
    }
  }

  static void cross(const Real *a, const Real *b, Real *c) {
    c[0] = a[1] * b[2] - a[2] * b[1]; c[1] = a[2] * b[0] - a[0] * b[2]; c[2] = a[0] * b[1] - a[1] * b[0];
  }

  void bending(const Real *x, Real *f) const {
    for (int s = 0; s < p.stencils; ++s) {
      const int32_t *c = p.stencil + 4 * s;
      const Real *w = p.stencil_weight + 4 * s;
      Real sum[3] = {}, size2 = 1e-18;
      for (int k = 0; k < 3; ++k) {
        for (int a = 0; a < 4; ++a) sum[k] += w[a] * x[3 * c[a] + k];
        size2 += sum[k] * sum[k];
      }
      const Real pull = p.stencil_stiff[s] * (1 - p.stencil_rest[s] / std::max(std::sqrt(size2), p.stencil_rest[s] / 2 + 1e-12));
      for (int a = 0; a < 4; ++a) for (int k = 0; k < 3; ++k) f[3 * c[a] + k] -= pull * w[a] * sum[k];
    }
  }

  void blow(const Real *x, const Real *v, Real time, Real *u) const {
    const Real lull = 1 + p.gust * std::sin(2 * PI * p.gust_rate * time);
    const Real high = p.shear > 0 ? std::pow(std::max(x[2], 0.01) / p.shear_height, p.shear) : 1;
    for (int k = 0; k < 3; ++k) u[k] = p.wind[k] * lull * high - v[k];
  }

  void air(const Real *x, const Real *v, Real time, Real *f) const {
    if (p.air <= 0) return;
    for (int t = 0; t < p.faces; ++t) {
      const int32_t *c = p.face + 3 * t;
      Real middle[3] = {}, speed[3] = {}, a[3], b[3], n[3], u[3];
      for (int k = 0; k < 3; ++k) {
        for (int j = 0; j < 3; ++j) { middle[k] += x[3 * c[j] + k] / 3; speed[k] += v[3 * c[j] + k] / 3; }
        a[k] = x[3 * c[1] + k] - x[3 * c[0] + k]; b[k] = x[3 * c[2] + k] - x[3 * c[0] + k];
      }
      cross(a, b, n);
      const Real twice = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) + 1e-18;
      blow(middle, speed, time, u);
      const Real along = (u[0] * n[0] + u[1] * n[1] + u[2] * n[2]) / twice;
      if (p.dim == 3 && along > 0) continue;  // the lee of a solid feels no pressure
      const Real size = std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) + 1e-12;
      const Real press = p.air * twice / 2 * size * std::pow(size / p.air_reference, p.air_exponent - 2);
      for (int j = 0; j < 3; ++j) for (int k = 0; k < 3; ++k)
        f[3 * c[j] + k] += press / 3 * (along * n[k] / twice + 0.05 * u[k]) * p.node_field[c[j]];
    }
    if (p.faces == 0) for (int i = 0; i < p.nodes; ++i) {
      Real u[3];
      blow(x + 3 * i, v + 3 * i, time, u);
      const Real size = std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) + 1e-12;
      const Real press = p.air * p.node_area[i] * size * std::pow(size / p.air_reference, p.air_exponent - 2) * p.node_field[i];
      for (int k = 0; k < 3; ++k) f[3 * i + k] += press * u[k];
    }
  }

  void grips(const Real *x, const Real *v, Real dt, Real time, Real *f) {
    const Real place = std::min(std::max(time * p.anchor_rate, 0.0), p.samples - 1.000001);
    const int s = (int)place;
    const Real w = place - s;
    for (int a = 0; a < p.grips; ++a) {
      const int i = p.grip_node[a];
      const Real *low = p.anchor + 3 * (s * p.grips + a), *high = low + 3 * p.grips;
      const Real k = p.grip_stiff[a], c = 0.3 * 2 * std::sqrt(k * p.mass[i]);
      Real pull[3], size2 = 1e-18;
      for (int j = 0; j < 3; ++j) {
        const Real goal = (1 - w) * low[j] + w * high[j] + slip[3 * a + j], speed = (high[j] - low[j]) * p.anchor_rate;
        pull[j] = k * (goal - x[3 * i + j]);
        size2 += pull[j] * pull[j];
        const Real force = pull[j] + c * (speed - v[3 * i + j]);
        f[3 * i + j] += force;
        work += force * speed * dt;
      }
      if (p.slip_rate > 0) {
        const Real size = std::sqrt(size2);
        if (size > p.slip_force) for (int j = 0; j < 3; ++j) {
          const Real move = -std::min(p.slip_rate * dt, 0.5 / k) * (size - p.slip_force) * pull[j] / size;
          slip[3 * a + j] += move;
        }
        p.slipped[a] = std::sqrt(slip[3 * a] * slip[3 * a] + slip[3 * a + 1] * slip[3 * a + 1] + slip[3 * a + 2] * slip[3 * a + 2]);
      }
    }
  }

  void ground(int i, const Real *x, const Real *v, Real dt, Real *f) const {
    const Real gap = x[2] - p.ground, m = p.mass[i], rate = 0.25 / p.step;
    if (p.adhesion > 0 && gap < 6 * p.adhesion_range) {
      const Real s = std::max(gap, 0.0) / p.adhesion_range;
      f[2] -= p.adhesion * p.node_area[i] * p.node_field[i] * (gap > 0 ? s * std::exp(1 - s) : 0);
    }
    if (gap >= 0) return;
    p.touched[i] += dt;
    const Real damping = 2 * m * rate * (1 - p.restitution);
    const Real normal = std::max(-m * rate * rate * gap - damping * v[2], 0.0);
    const Real speed = std::sqrt(v[0] * v[0] + v[1] * v[1]) + 1e-12;
    const Real ratio = p.stribeck > 0 ? speed / p.stribeck_speed : 0;
    const Real mu = p.friction + p.stribeck * p.node_field[i] * std::exp(-ratio * ratio);
    // Coulomb: the friction of a step may stop a node, not turn it around; a node at rest balances what pushes it.
    const Real push[2] = {f[0] + m * v[0] / dt, f[1] + m * v[1] / dt};
    const Real need = std::sqrt(push[0] * push[0] + push[1] * push[1]) + 1e-12;
    const Real held = std::min(mu * normal, need);
    f[0] -= held * push[0] / need;
    f[1] -= held * push[1] / need;
    f[2] += normal;
  }

  void meet(const Real *x, const Real *v, Real dt, Real *f) {
    const Real reach = p.contact_radius;
    if (age-- <= 0) {
      pairs.clear();
      const Real far = 1.6 * reach, apart = 2.2 * reach;
      for (int i = 0; i < p.nodes; ++i) for (int j = i + 1; j < p.nodes; ++j) {
        Real now = 0, rest = 0;
        for (int k = 0; k < 3; ++k) {
          now += (x[3 * i + k] - x[3 * j + k]) * (x[3 * i + k] - x[3 * j + k]);
          rest += (p.rest[3 * i + k] - p.rest[3 * j + k]) * (p.rest[3 * i + k] - p.rest[3 * j + k]);
        }
        if (now < far * far && rest > apart * apart) { pairs.push_back(i); pairs.push_back(j); }
      }
      age = 12;
    }
    for (size_t c = 0; c < pairs.size(); c += 2) {
      const int i = pairs[c], j = pairs[c + 1];
      Real d[3], size2 = 1e-18, close = 0;
      for (int k = 0; k < 3; ++k) { d[k] = x[3 * j + k] - x[3 * i + k]; size2 += d[k] * d[k]; }
      const Real size = std::sqrt(size2);
      if (size >= reach) continue;
      p.met[i] += dt; p.met[j] += dt;
      for (int k = 0; k < 3; ++k) close += (v[3 * j + k] - v[3 * i + k]) * d[k] / size;
      const Real m = std::min(p.mass[i], p.mass[j]);
      const Real push = std::max(p.contact_stiff * (reach - size) - 0.6 * std::sqrt(p.contact_stiff * m) * close, 0.0);
      for (int k = 0; k < 3; ++k) {
        const Real slide = v[3 * j + k] - v[3 * i + k] - close * d[k] / size;
        const Real drag = std::min(0.3 * push / 0.05, 0.2 * m / dt) * slide;
        f[3 * i + k] -= push * d[k] / size - drag;
        f[3 * j + k] += push * d[k] / size - drag;
      }
    }
  }
};

template <int D> int run(const Problem &p) {
  Body<D> body(p);
  Surroundings around(p);
  const int n = 3 * p.nodes;
  std::vector<Real> x(p.start, p.start + n), v(n, 0.0), f(n, 0.0);
  Real elastic = body.forces(x.data(), v.data(), 0, p.times[0], f.data());
  around.forces(x.data(), v.data(), 1e-9, p.times[0], f.data());
  for (int frame = 0; frame < p.frames; ++frame) {
    if (frame > 0) {
      const Real span = p.times[frame] - p.times[frame - 1];
      const int steps = std::max(1, (int)std::ceil(span / p.step));
      const Real dt = span / steps;
      for (int s = 0; s < steps; ++s) {
        const Real time = p.times[frame - 1] + (s + 1) * dt;
        for (int i = 0; i < n; ++i) { v[i] += dt / 2 * f[i] / p.mass[i / 3]; x[i] += dt * v[i]; f[i] = 0; }
        elastic = body.forces(x.data(), v.data(), dt, time, f.data());
        around.forces(x.data(), v.data(), dt, time, f.data());
        for (int i = 0; i < n; ++i) v[i] += dt / 2 * f[i] / p.mass[i / 3];
      }
    }
    Real kinetic = 0, height = 0;
    for (int i = 0; i < p.nodes; ++i) for (int k = 0; k < 3; ++k) {
      kinetic += p.mass[i] * v[3 * i + k] * v[3 * i + k] / 2;
      height -= p.mass[i] * p.gravity[k] * x[3 * i + k];
    }
    const Real row[4] = {kinetic, elastic, height, around.work};
    std::memcpy(p.energy + 4 * frame, row, sizeof row);
    std::memcpy(p.out + frame * n, x.data(), n * sizeof(Real));
    for (int i = 0; i < n; ++i) if (!std::isfinite(x[i]) || std::fabs(x[i]) > 100) return frame + 1;
  }
  return 0;
}

}  // namespace

// 0: done; else 1 + the frame in which the motion ran away.
extern "C" int32_t simulate(const Problem *problem) {
  switch (problem->dim) {
    case 1: return run<1>(*problem);
    case 2: return run<2>(*problem);
    default: return run<3>(*problem);
  }
}
extern "C" int64_t problem_bytes() { return sizeof(Problem); }
