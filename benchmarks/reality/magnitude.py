"""How large a withheld effect is: the gap that a refit of the base leaves, in units of what hides it.

With e the change of the observed motion by the effect, J the changes by base parameters (stiffness of both
halves, viscosity, drag, friction) and s² = noise² + discretisation²:

    magnitude = rms(e - J theta) / s,   theta from bounded least squares.

Discretisation is the rms change by a mesh 1.6 times coarser, after the same projection: no twin has the mesh
of reality, so that much of any gap is hidden. The rms is over points, frames and coordinates. The refit is
then checked: the base is simulated again with theta, and where the rest is smaller than the linear one, it
is what is reported.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from benchmarks.reality.world import Array, Effect, Material, Motion, Runaway, World

Simulate = Callable[[World], Motion]
COARSER = 1.6
CLOSE = 1.25
"""A magnitude within this factor of its target will do."""
ROUGH, FINE = 6, 4
"""Most simulations with an effect: of the coarser world, where its amplitude is sought, and of the world."""
ACCEPTED = (0.4, 6.0)
LIMIT = 1.6
"""How far a logarithm of a base parameter may move."""


@dataclass(frozen=True)
class Yardstick:
    """The base motion of a world, what its parameters can do, and what hides a gap."""

    world: World
    base: Array
    parameters: tuple[str, ...]
    orthonormal: Array
    triangular: Array
    noise: float
    discretisation: float
    coarse_world: World
    coarse: Array
    """Motion of the coarser world."""

    @property
    def hidden(self) -> float:
        """[m]."""
        return float(np.hypot(self.noise, self.discretisation))

    def refit(self, points: Array) -> tuple[Array, Array]:
        """Parameters that explain most of `points` - base, and what they leave."""
        change = (points - self.base).ravel()
        seen = self.orthonormal.T @ change
        theta = lsq_linear(self.triangular, seen, (-LIMIT, LIMIT)).x
        return theta, change - self.orthonormal @ (self.triangular @ theta)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def changed(material: Material, name: str, by: float) -> Material:
    """A base parameter times exp(by)."""
    low, high = material.stiffness
    factor = float(np.exp(by))
    if name == "stiffness":
        return replace(material, stiffness=(low * factor, high))
    if name == "other stiffness":
        return replace(material, stiffness=(low, high * factor))
    return replace(material, **{name: getattr(material, name) * factor})


def coarser(world: World) -> World:
    """The same world on another, coarser mesh."""
    return replace(world, spacing=world.spacing * COARSER, mesh_seed=world.mesh_seed + 1)


def hopeless(
    world: World, effect: Effect, limits: tuple[float, float], simulate: Simulate, noise: float
) -> bool:
    """Whether the effect at its largest moves the coarser world less than what counts, before any refit."""
    plain = coarser(world)
    try:
        change = simulate(plain.with_effects(replace(effect, amplitude=limits[1]))).points
    except Runaway:
        return False
    return _rms(change - simulate(plain).points) < ACCEPTED[0] * noise


def measure(world: World, simulate: Simulate, noise: float) -> Yardstick:
    """Simulate the base world, its derivatives and its coarser self."""
    base = simulate(world).points
    names = ["stiffness", "other stiffness", "damping", "drag_rate"]
    if world.scene.ground is not None:
        names.append("friction")
    columns = []
    for name in names:
        step = 0.15
        moved = simulate(replace(world, material=changed(world.material, name, step))).points
        columns.append((moved - base).ravel() / step)
    q, r = np.linalg.qr(np.stack(columns, axis=1))
    other = coarser(world)
    coarse = simulate(other).points
    plain = Yardstick(world, base, tuple(names), q, r, noise, 0.0, other, coarse)
    return replace(plain, discretisation=_rms(plain.refit(coarse)[1]))


def gap(stick: Yardstick, points: Array) -> float:
    """Magnitude of a change, by the linear refit."""
    return _rms(stick.refit(points)[1]) / stick.hidden


def checked_gap(stick: Yardstick, points: Array, simulate: Simulate) -> float:
    """Magnitude of a change, by the better of the linear refit and a simulation of the refitted base."""
    theta, rest = stick.refit(points)
    material = stick.world.material
    for name, by in zip(stick.parameters, theta, strict=True):
        material = changed(material, name, float(by))
    try:
        again = simulate(replace(stick.world, material=material)).points
    except Runaway:
        return _rms(rest) / stick.hidden
    return min(_rms(rest), _rms(points - again)) / stick.hidden


@dataclass(frozen=True)
class Tuned:
    """An effect of the size that was asked for."""

    effect: Effect
    magnitude: float
    motion: Motion
    """Of the world with it alone."""


def tune(
    stick: Yardstick,
    effect: Effect,
    limits: tuple[float, float],
    target: float,
    simulate: Simulate,
    within: float = np.inf,
) -> Tuned | None:
    """The amplitude at which the effect has the target magnitude, found by secants on logarithms.

    It is sought in the coarser world, which costs little, and then corrected in the world itself. Where the
    target is out of reach, the nearest that was tried is taken, if it is within `ACCEPTED` and a factor of
    `within` of the target: what counts is the magnitude measured. None: there is none such.
    """

    def roughly(amplitude: float) -> float:
        world = stick.coarse_world.with_effects(replace(effect, amplitude=amplitude))
        return gap(stick, stick.base + simulate(world).points - stick.coarse)

    motions: dict[float, Motion] = {}

    def truly(amplitude: float) -> float:
        motions[amplitude] = simulate(stick.world.with_effects(replace(effect, amplitude=amplitude)))
        return checked_gap(stick, motions[amplitude].points, simulate)

    low, high = limits
    rough = _seek(roughly, float(np.sqrt(low * high)), limits, target, ROUGH)
    if not rough or _nearest(rough, target)[1] < target / within / 2:
        return None
    found = _seek(truly, _nearest(rough, target)[0], limits, target, FINE)
    reached = [pair for pair in found if ACCEPTED[0] <= pair[1] <= ACCEPTED[1]]
    if not reached:
        return None
    amplitude, value = _nearest(reached, target)
    if not target / within <= value <= target * within:
        return None
    return Tuned(replace(effect, amplitude=amplitude), value, motions[amplitude])


Tried = list[tuple[float, float]]
"""Amplitudes and the magnitudes they have."""


def _seek(
    measured: Callable[[float], float],
    amplitude: float,
    limits: tuple[float, float],
    target: float,
    attempts: int,
) -> Tried:
    low, top = limits
    tried: Tried = []
    for _ in range(attempts):
        try:
            value = measured(amplitude)
        except Runaway:
            top = amplitude
            below = max((a for a, _ in tried if a < amplitude), default=low)
            if amplitude < 1.5 * below:
                break
            amplitude = float(np.sqrt(below * amplitude))
            continue
        tried.append((amplitude, value))
        if target / CLOSE <= value <= target * CLOSE:
            break
        amplitude = _next(tried, target, low, top)
        if any(abs(np.log(amplitude / was)) < 0.05 for was, _ in tried):
            break
    return tried


def _nearest(tried: Tried, target: float) -> tuple[float, float]:
    return min(tried, key=lambda pair: abs(np.log(max(pair[1], 1e-9) / target)))


def _next(tried: Tried, target: float, low: float, high: float) -> float:
    below = [pair for pair in tried if pair[1] < target]
    above = [pair for pair in tried if pair[1] >= target]
    if below and above:
        (a, g), (b, h) = max(below), min(above)
        share = np.log(target / max(g, 1e-9)) / max(np.log(h / max(g, 1e-9)), 1e-6)
        return float(np.clip(a * (b / a) ** np.clip(share, 0.1, 0.9), low, high))
    amplitude, value = tried[-1]
    factor = np.clip(target / max(value, 1e-6), 1 / 40, 40)
    return float(np.clip(amplitude * factor, low, high))
