"""The withheld effects of the MuJoCo generator: tensions of springs, forces on particles and cells."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import Delaunay, cKDTree
from scipy.special import erf

from benchmarks.reality.nets import Lattice
from benchmarks.reality.world import Array, Effect, World


@dataclass
class State:
    """One moment, as the effects see it."""

    x: Array
    v: Array
    t: float
    dt: float


Force = Callable[[State], Array]
Law = Callable[[State, Array, Array, Array], Array]
"""Strain, its rate and direction of each spring to its extra tension [N]."""


class Laws:
    """Each effect adds its law to those of a run, by the method of its name."""

    world: World
    net: Lattice
    start: Array
    mass: Array
    rest: Array
    stiffness: Array
    stiffer: float
    """By how much the laws may raise the stiffness of a spring, for the time step."""
    slip: tuple[float, float]
    forces: list[Force]
    axial: list[Law]
    met: Array
    near: Array

    # Effects along springs: tensions [e] in N.

    def _where(self, effect: Effect) -> Array:
        return effect.where(self.net.nodes[self.net.springs].mean(axis=1)) * self.stiffness * self.rest

    def _strain_stiffening(self, effect: Effect) -> None:
        where, a, options = self._where(effect), effect.amplitude, effect.options
        if options["form"] == 0.0:
            p, s = float(options["exponent"]), float(options["scale"])
            self.axial.append(lambda now, e, rate, way: where * a * np.minimum(np.abs(e) / s, 2.5) ** p * e)
            self.stiffer += a * 2.5**p
        else:
            r = float(options["rate"])
            self.axial.append(
                lambda now, e, rate, way: where * a / r * np.expm1(np.minimum(r * e**2, 3.0)) * e
            )
            self.stiffer += a / r * np.expm1(3.0)

    def _tension_only(self, effect: Effect) -> None:
        where, a = self._where(effect), effect.amplitude
        self.axial.append(lambda now, e, rate, way: -where * a * np.minimum(e, 0))

    def _viscoelasticity(self, effect: Effect) -> None:
        where, a = self._where(effect), effect.amplitude / 2
        branches = [(float(effect.options[key]), np.zeros(len(self.rest))) for key in ("fast", "slow")]

        def law(now: State, e: Array, rate: Array, way: Array) -> Array:
            total = np.zeros_like(e)
            for tau, q in branches:
                keep = np.exp(-now.dt / tau)
                q *= keep
                q += a * tau * (1 - keep) * rate
                total += q
            return where * total

        self.axial.append(law)
        self.stiffer += effect.amplitude

    def _plasticity(self, effect: Effect) -> None:
        where, a = self._where(effect), effect.amplitude
        z, limit, sharp = (
            np.zeros(len(self.rest)),
            float(effect.options["yield"]),
            float(effect.options["sharpness"]),
        )

        def law(now: State, e: Array, rate: Array, way: Array) -> Array:
            spent = np.where(z * rate > 0, np.minimum(np.abs(z) / limit, 3.0) ** sharp, 0.0)
            z[:] += now.dt * rate * (1 - np.minimum(spent, 1.0))
            return where * a * (z - e)

        self.axial.append(law)

    def _damage(self, effect: Effect) -> None:
        where, a, scale = self._where(effect), effect.amplitude, float(effect.options["scale"])
        peak = np.zeros(len(self.rest))

        def law(now: State, e: Array, rate: Array, way: Array) -> Array:
            np.maximum(peak, np.abs(e), out=peak)
            return -where * a * erf((peak - np.abs(e)) / scale) * e

        self.axial.append(law)

    def _anisotropy(self, effect: Effect) -> None:
        angle = float(effect.options["angle"])
        rest = self.net.nodes[self.net.springs[:, 1]] - self.net.nodes[self.net.springs[:, 0]]
        along = (rest / self.rest[:, None]) @ [np.cos(angle), np.sin(angle), 0.0]
        where = self._where(effect) * along**4
        self.axial.append(lambda now, e, rate, way: where * effect.amplitude * e)
        self.stiffer += effect.amplitude

    def _shrinkage(self, effect: Effect) -> None:
        where, end = self._where(effect), float(self.world.scene.times[-1])
        strain = effect.amplitude * float(effect.options["sign"])
        self.axial.append(lambda now, e, rate, way: -where * strain * min(now.t / end, 1.0))

    # Effects on particles and cells: forces [n, 3] in N.

    def _bending_stiffness(self, effect: Effect) -> None:
        a, b, c = self.net.triplets.T
        nodes, length = self.net.nodes, self.world.shape.length
        left = np.linalg.norm(nodes[b] - nodes[a], axis=1)
        right = np.linalg.norm(nodes[c] - nodes[b], axis=1)
        unit = self.world.material.density * 9.81 * length**3
        wide = 2 / (left + right) if self.world.shape.kind == "rope" else np.ones(len(a))
        relative = self.world.material.bending + effect.amplitude * effect.where(nodes[b])
        stiff = (unit * wide * relative)[:, None]
        count, row = len(nodes), np.arange(len(a))
        weights = csr_matrix(
            (
                np.concatenate([1 / left, -1 / left - 1 / right, 1 / right]),
                (np.tile(row, 3), np.concatenate([a, b, c])),
            ),
            (len(a), count),
        )
        rest = np.linalg.norm(weights @ nodes, axis=1, keepdims=True)

        def bend(now: State) -> Array:
            curve = weights @ now.x
            size = np.maximum(np.linalg.norm(curve, axis=1, keepdims=True), rest / 2 + 1e-12)
            return -weights.T @ (stiff * (1 - rest / size) * curve)

        self.forces.append(bend)
        highest = (abs(weights).T @ (stiff * np.asarray(abs(weights).sum(axis=1)))).ravel()
        load = np.zeros(count)
        np.add.at(load, self.net.springs, np.repeat(self.stiffness[:, None], 2, axis=1))
        self.stiffer += float((highest / self.mass).max() / (2 * load / self.mass).max())

    def _volume_preservation(self, effect: Effect) -> None:
        nodes = self.net.nodes
        cells = Delaunay(nodes).simplices
        edges = nodes[cells[:, [0, 0, 0, 1, 1, 2]]] - nodes[cells[:, [1, 2, 3, 2, 3, 3]]]
        volume = np.linalg.det(nodes[cells[:, 1:]] - nodes[cells[:, :1]]) / 6
        longest = 1.6 * np.median(self.rest)
        good = (np.linalg.norm(edges, axis=2).max(axis=1) < longest) & (
            np.abs(volume) > 0.01 * longest**3 / 6
        )
        cells, volume = cells[good], volume[good]
        flip = volume < 0
        cells[flip] = cells[flip][:, [0, 1, 3, 2]]
        volume = np.abs(volume)
        young = np.mean(self.world.material.stiffness) * 1.2
        stiff = effect.amplitude * young * effect.where(nodes[cells].mean(axis=1))
        count, row = len(nodes), np.arange(len(cells))
        gathers = [
            csr_matrix((np.ones(len(cells)), (cells[:, k], row)), (count, len(cells))) for k in range(4)
        ]

        def bulge(now: State) -> Array:
            p = now.x[cells]
            a, b, c = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]
            slopes = [np.cross(b, c) / 6, np.cross(c, a) / 6, np.cross(a, b) / 6]
            swollen = (a * slopes[0]).sum(axis=1) / volume - 1
            push = (-stiff * swollen)[:, None]
            total = -gathers[0] @ (push * (slopes[0] + slopes[1] + slopes[2]))
            return total + sum(g @ (push * s) for g, s in zip(gathers[1:], slopes, strict=True))

        self.forces.append(bulge)
        self.stiffer += effect.amplitude * 2

    def _quadratic_air_drag(self, effect: Effect) -> None:
        c = (effect.amplitude * self.net.area * effect.where(self.net.nodes))[:, None]
        p = float(effect.options["exponent"]) - 1
        self.forces.append(
            lambda now: -c * (np.linalg.norm(now.v, axis=1, keepdims=True) + 1e-9) ** p * now.v
        )

    def _wind(self, effect: Effect) -> None:
        o = effect.options
        way = np.asarray(o["direction"]) * float(o["speed"])
        c = (0.5 * effect.amplitude * self.net.area)[:, None]

        def blow(now: State) -> Array:
            lull = 1 + float(o["gust"]) * np.sin(2 * np.pi * float(o["gust_rate"]) * now.t)
            high = (np.maximum(now.x[:, 2:], 0.01) / 0.3) ** float(o["shear"])
            u = way * lull * high - now.v
            return c * np.linalg.norm(u, axis=1, keepdims=True) * u

        self.forces.append(blow)

    def _gravity_tilt(self, effect: Effect) -> None:
        force = self.mass[:, None] * np.asarray(effect.options["direction"]) * effect.amplitude
        self.forces.append(lambda now: force)

    def _mass_heterogeneity(self, effect: Effect) -> None:
        self.mass = self.mass * (1 + effect.amplitude * effect.where(self.net.nodes))

    def _grip_slip(self, effect: Effect) -> None:
        held = sum(
            max(int((np.linalg.norm(self.start - hand.place, axis=1) <= hand.reach).sum()), 1)
            for hand in self.world.scene.hands
        )
        weight = float(self.mass.sum()) * 9.81 / max(held, 1)
        self.slip = (float(effect.options["threshold"]) * weight, effect.amplitude * 0.05 / weight)

    def _adhesion(self, effect: Effect) -> None:
        reach, ground = float(effect.options["range"]), self.world.scene.ground
        if ground is None:
            return
        pull = effect.amplitude * np.maximum(self.net.area, self.net.area[self.net.area > 0].min())

        def stick(now: State) -> Array:
            s = np.clip((now.x[:, 2] - ground) / reach, 0, 6)
            force = np.zeros_like(now.x)
            force[:, 2] = -pull * s * np.exp(1 - s) * (s < 6)
            return force

        self.forces.append(stick)

    def _static_friction(self, effect: Effect) -> None:
        ground, slow = self.world.scene.ground, float(effect.options["speed"])
        if ground is None:
            return

        def hold(now: State) -> Array:
            force = np.zeros_like(now.x)
            low = now.x[:, 2] < ground + 0.002
            v = now.v[low, :2]
            speed = np.linalg.norm(v, axis=1, keepdims=True) + 1e-9
            weight = self.mass[low, None] * 9.81
            most = effect.amplitude * weight * np.exp(-((speed / slow) ** 2))
            force[low, :2] = -np.minimum(most, 0.3 * self.mass[low, None] * speed / now.dt) * v / speed
            return force

        self.forces.append(hold)

    def _self_collision(self, effect: Effect) -> None:
        reach = effect.amplitude
        rest = self.net.nodes
        load = np.zeros(len(self.mass))
        np.add.at(load, self.net.springs, np.repeat(self.stiffness[:, None], 2, axis=1))
        stiff = float(np.median(load))
        age = [0]

        def part(now: State) -> Array:
            if age[0] <= 0:
                pairs = cKDTree(now.x).query_pairs(1.6 * reach, output_type="ndarray")
                apart = np.linalg.norm(rest[pairs[:, 0]] - rest[pairs[:, 1]], axis=1) > 2.2 * reach
                self.near, age[0] = pairs[apart], 8
            age[0] -= 1
            force = np.zeros_like(now.x)
            if not len(self.near):
                return force
            i, j = self.near.T
            way = now.x[j] - now.x[i]
            size = np.linalg.norm(way, axis=1) + 1e-12
            close = ((now.v[j] - now.v[i]) * way).sum(axis=1) / size
            m = np.minimum(self.mass[i], self.mass[j])
            push = np.where(
                size < reach, np.maximum(stiff * (reach - size) - 0.5 * np.sqrt(stiff * m) * close, 0), 0
            )
            vector = (push / size)[:, None] * way
            np.add.at(force, j, vector)
            np.add.at(force, i, -vector)
            hit = size < reach
            np.add.at(self.met, i[hit], now.dt)
            np.add.at(self.met, j[hit], now.dt)
            return force

        self.forces.append(part)

    def _magnet(self, effect: Effect) -> None:
        o = effect.options
        x, y, _ = self.world.scene.shift
        place = np.array([x + float(o["aside"]), y + float(o["along"]), float(o["high"])])

        def draw(now: State) -> Array:
            way = place - now.x
            r = np.sqrt((way**2).sum(axis=1, keepdims=True) + 0.06**2)
            return self.mass[:, None] * effect.amplitude * (0.1 / r) ** float(o["exponent"]) * way / r

        self.forces.append(draw)

    def _moving_base(self, effect: Effect) -> None:
        spin = np.asarray(effect.options["axis"]) * effect.amplitude
        # The cross product with the spin, as a matrix.
        turn = np.array([[0, -spin[2], spin[1]], [spin[2], 0, -spin[0]], [-spin[1], spin[0], 0]])
        centre = self.world.scene.shift
        self.forces.append(
            lambda now: -self.mass[:, None] * (2 * now.v @ turn.T + (now.x - centre) @ (turn @ turn).T)
        )

    def _stick_patch(self, effect: Effect) -> None:
        m = (self.mass * effect.where(self.net.nodes))[:, None]
        c = 0.2 * np.sqrt(effect.amplitude)
        self.forces.append(lambda now: m * (effect.amplitude * (self.start - now.x) - c * now.v))

    def _buoyancy(self, effect: Effect) -> None:
        height = float(effect.options["height"]) - (0.4 if self.world.scene.ground is None else 0.0)
        up = -self.mass[:, None] * np.asarray(self.world.scene.gravity) * effect.amplitude
        self.forces.append(lambda now: up * np.clip((height - now.x[:, 2:]) / 0.1, 0, 1))
