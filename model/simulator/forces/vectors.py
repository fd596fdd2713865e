"""Vectors of three scalars, which may be numbers, tensors or symbols."""

from typing import TypeAlias

from model.simulator.forces.base import Scalar

Vector: TypeAlias = tuple[Scalar, ...]
"""Three components."""


def minus(a: Vector, b: Vector) -> Vector:
    """Difference, a - b."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


def plus(a: Vector, b: Vector) -> Vector:
    """Sum, a + b."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


def times(by: Scalar, a: Vector) -> Vector:
    """A multiple."""
    return tuple(by * x for x in a)


def dot(a: Vector, b: Vector) -> Scalar:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Outer product, a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
