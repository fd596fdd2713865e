// The end of a substep: the ground, and the next places.

// The velocity after contact with the ground, how fast it came near, and the share of the slip that is kept.
INLINE void ground(const Frame &f, int64_t slice, const V me[8], V out[8]) {
  const V mu = load(f.friction + W * slice), e = load(f.restitution + W * slice);
  M meets = (me[2] + R(f.dt) * out[5] < load(f.height + W * slice)) & (out[5] < 0);
  V approach = meets ? -out[5] : splat(0);
  V slip = larger(root(out[3] * out[3] + out[4] * out[4]), splat(SLOWEST));
  V kept = larger(1 - mu * (1 + e) * approach / slip, splat(0));
  kept = meets ? kept : splat(1);
  out[3] *= kept;
  out[4] *= kept;
  out[5] = meets ? e * approach : out[5];
  out[6] = approach;
  out[7] = kept;
}

// From the velocity that the forces leave to the next state.
INLINE void land(const Frame &f, int64_t slice, const V me[8], V out[8]) {
  out[6] = out[7] = splat(0);
  if (GROUND) ground(f, slice, me, out);
  for (int k = 0; k < 3; ++k) out[k] = me[k] + splat(R(f.dt)) * out[3 + k];
}
