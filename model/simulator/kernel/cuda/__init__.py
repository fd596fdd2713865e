"""The fast path on a CUDA device: the same traced laws in an engine of one thread per point.

- `emit` writes the laws into `engine.cu`; `compiler` has NVRTC compile it and caches the result; `module`
  loads it and launches it on the stream that torch is on;
- `layout` says where points and springs lie in memory, `frame` what a launch is told; `program` and
  `function` run a frame and its adjoint as an operation of autograd;
- `kernel` does all of that for the terms of a rollout.

Nothing but the driver and NVRTC is needed, which every CUDA build of torch brings along or needs itself.
"""
