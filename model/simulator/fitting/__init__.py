"""Fitting parameters of a simulator to what really moved; `fit.fit` is the way in."""
