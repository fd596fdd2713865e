"""The fast path: the laws of a simulator traced once, generated as C++, compiled, and run by frames.

The torch oracle (`Dynamics` and an integrator) says what is right; this says the same, faster. On the way:

- `groups` and `corners` run the laws on symbols (`expression`, `graph`) and differentiate them
  (`differentiate`); `emit` writes them into `engine`, which has the loops; `build` compiles and caches;
- `arrange` and `layout` say where points and springs lie in memory; `call`, `program` and `function` run a
  frame and its adjoint as an operation of autograd;
- `terms` says which terms a rollout has and what their constants are, or which of them no kernel can take;
  `kernel` does all of the above for them, and `cuda` does the same for a device.

It differentiates once: `torch.func` transforms and second derivatives are the oracle's (`backend="torch"`).
"""
