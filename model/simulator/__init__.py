"""The differentiable simulator: forces, contacts and an integrator, composed; in plain torch, the oracle.

Laws are scalar functions (`Spring.law`, `coulomb`, …); base classes map them over springs, points and
contacts, so that another evaluator can use the same laws. Design section 7 has the equations.
"""
