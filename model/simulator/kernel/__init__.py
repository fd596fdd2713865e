"""The fast path: the laws of a simulator traced once, generated as C++, compiled, and run by frames.

The torch oracle (`Dynamics` and an integrator) says what is right; this says the same, faster.
"""
