"""The MuJoCo generator: particles on another lattice, tendons as springs, its own integrator and contacts.

Particles are bodies with three slide joints; each spring is a spatial tendon with stiffness and damping; the
ground is MuJoCo's plane with an elliptic friction cone. Hands and withheld effects are applied forces,
written in numpy over springs, particles or cells. Amplitudes mean what they mean in `fem.py`, the laws are
those of springs.
"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import Delaunay, cKDTree
from scipy.special import erf

from benchmarks.reality.hands import follow, held_share
from benchmarks.reality.shapes import Shape
from benchmarks.reality.skin import attach, carry
from benchmarks.reality.world import RATE, Array, Effect, Motion, Runaway, World

RADIUS = 0.003
SAFETY = 0.8
LONGEST = 0.002
COST = 6e6
"""Steps times particles, beyond which nobody waits."""
Force = Callable[["_State"], Array]


@dataclass
class _State:
    """One moment, as the effects see it."""

    x: Array
    v: Array
    t: float
    dt: float


@dataclass(frozen=True)
class Lattice:
    """Nodes [n, 3] m, springs [e, 2], their stiffness per Young's modulus [e], triplets that bend [b, 3]."""

    nodes: Array
    springs: Array
    unit: Array
    share: Array
    """Of the measure of the object, per node."""
    area: Array
    triplets: Array


def lattice(shape: Shape, spacing: float, seed: int) -> Lattice:
    """A chain, a square net with diagonals turned against the cloth, or a body-centred lattice."""
    rng = np.random.default_rng(seed)
    return {"rope": _chain, "sheet": _net, "solid": _centred}[shape.kind](shape, spacing, rng)


def _chain(shape: Shape, spacing: float, rng: np.random.Generator) -> Lattice:
    s = np.linspace(0, 2.0, 4001)
    length = s[shape.inside(s[:, None])].max()
    count = max(round(length / spacing), 8)
    nodes = shape.curve(np.linspace(0, length, count + 1))
    index = np.arange(count + 1)
    springs = np.stack([index[:-1], index[1:]], axis=1)
    share = np.full(count + 1, length / count)
    share[[0, -1]] /= 2
    triplets = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
    return Lattice(nodes, springs, np.full(count, count / length), share, share * 2 * shape.radius, triplets)


def _net(shape: Shape, spacing: float, rng: np.random.Generator) -> Lattice:
    low, high = shape.box[:, :2]
    count = np.maximum(np.round((high - low) / spacing).astype(int), 4)
    step = (high - low) / count
    grid = np.stack(
        np.meshgrid(np.arange(count[0] + 1), np.arange(count[1] + 1), indexing="ij"), axis=-1
    ).reshape(-1, 2)
    flat = low + grid * step
    kept = shape.inside(np.column_stack([flat * (1 - 1e-9), np.zeros(len(flat))]))
    grid, flat = grid[kept], flat[kept]
    nodes = np.column_stack([flat, shape.relief(flat)])
    index = {tuple(cell): k for k, cell in enumerate(grid)}
    springs, unit, triplets = [], [], []
    for cell, k in index.items():
        for way, strength in (((1, 0), 0.75), ((0, 1), 0.75), ((1, 1), 0.375), ((1, -1), 0.375)):
            other = index.get((cell[0] + way[0], cell[1] + way[1]))
            before = index.get((cell[0] - way[0], cell[1] - way[1]))
            if other is not None:
                springs.append((k, other))
                unit.append(strength)
                if before is not None and 0 in way:
                    triplets.append((before, k, other))
    share = np.full(len(nodes), step.prod())
    return Lattice(nodes, np.array(springs), np.array(unit), share, share, np.array(triplets))


def _centred(shape: Shape, spacing: float, rng: np.random.Generator) -> Lattice:
    side = spacing * 1.25
    low, high = shape.box
    count = np.maximum(np.round((high - low) / side).astype(int), 2)
    step = (high - low) / count
    corners = np.stack(np.meshgrid(*(np.arange(c + 1) for c in count), indexing="ij"), axis=-1).reshape(-1, 3)
    centres = (
        np.stack(np.meshgrid(*(np.arange(c) for c in count), indexing="ij"), axis=-1).reshape(-1, 3) + 0.5
    )
    grid = np.concatenate([corners, centres])
    middle = (low + high) / 2
    nodes = low + grid * step
    nodes = nodes[shape.inside(middle + (nodes - middle) * (1 - 1e-6))]
    pairs = cKDTree(nodes / step).query_pairs(1.05, output_type="ndarray")
    length = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    degree = np.bincount(pairs.ravel(), minlength=len(nodes))
    used = np.flatnonzero(degree >= 3)
    renumber = np.full(len(nodes), -1)
    renumber[used] = np.arange(len(used))
    kept = (renumber[pairs] >= 0).all(axis=1)
    springs, nodes, degree = renumber[pairs[kept]], nodes[used], degree[used]
    unit = 0.45 * side**2 / length[kept]
    share = np.where(degree < 10, 0.6, 1.0) * step.prod() / 2
    area = np.where(degree < 10, side**2 / 1.5, 0.0)
    return Lattice(nodes, springs, unit, share, area, np.zeros((0, 3), int))


def simulate(world: World) -> Motion:
    """Move a world.

    Raises:
        Runaway: it left the finite numbers, or would need too many steps.
    """
    return _Run(world, lattice(world.shape, world.spacing, world.mesh_seed)).result()


class _Run:
    def __init__(self, world: World, net: Lattice) -> None:
        self.world, self.net = world, net
        scene, material = world.scene, world.material
        self.start = net.nodes @ scene.turn.T + scene.shift
        self.mass = material.density * net.share
        self.rest = np.linalg.norm(net.nodes[net.springs[:, 1]] - net.nodes[net.springs[:, 0]], axis=1)
        low, high = material.stiffness
        middle = net.nodes[net.springs].mean(axis=1) - world.shape.surface.mean(axis=0)
        blend = 1 / (1 + np.exp(-np.clip(middle[:, 0] / (0.05 * world.shape.length), -40, 40)))
        self.stiffness = net.unit * (low * (1 - blend) + high * blend)
        rows, columns = net.springs.T, np.arange(len(net.springs))
        ends = np.concatenate([rows[0], rows[1]])
        signs = np.concatenate([np.ones(len(columns)), -np.ones(len(columns))])
        self.gather = csr_matrix((signs, (ends, np.tile(columns, 2))), (len(net.nodes), len(columns)))
        self.forces: list[Force] = []
        self.axial: list[Callable[[_State, Array, Array, Array], Array]] = []
        self.stiffer = 1.0
        self.slip = (0.0, 0.0)
        self.touched, self.met = np.zeros(len(self.mass)), np.zeros(len(self.mass))
        self.near = np.zeros((0, 2), int)
        if world.material.bending > 0 and not any(e.name == "bending_stiffness" for e in world.effects):
            self._bending_stiffness(Effect("bending_stiffness", 0.0))
        for effect in world.effects:
            if effect.name not in ("actuation_delay", "hand_torque"):
                getattr(self, f"_{effect.name}")(effect)
        self._hands()

    def result(self) -> Motion:
        model, dt = self._model()
        data = mujoco.MjData(model)
        data.qvel[:] = 0
        times, frames = self.world.scene.times, []
        data.time = float(times[0])
        for frame, time in enumerate(times):
            steps = 0 if frame == 0 else max(int(np.ceil((time - times[frame - 1]) / dt)), 1)
            if steps:
                model.opt.timestep = (time - times[frame - 1]) / steps
            for s in range(steps):
                now = _State(
                    data.qpos.reshape(-1, 3) + self.start,
                    data.qvel.reshape(-1, 3),
                    times[frame - 1] + s * model.opt.timestep,
                    model.opt.timestep,
                )
                data.qfrc_applied[:] = self._applied(now).ravel()
                mujoco.mj_step(model, data)
            frames.append(data.qpos.reshape(-1, 3) + self.start)
            if (
                not np.isfinite(frames[-1]).all()
                or np.abs(data.qpos).max() > 20
                or any(w.number for w in data.warning)
            ):
                raise Runaway(f"frame {frame}")
        nodes = np.stack(frames)
        index, weight = attach(
            self.world.shape.surface, self.net.nodes, 4 if self.world.shape.kind == "rope" else 8
        )
        acts = {effect.name: self._acts(effect, index, weight) for effect in self.world.effects}
        return Motion(carry(nodes, index, weight), acts, nodes, np.zeros((0, 4)))

    def _model(self) -> tuple[mujoco.MjModel, float]:
        scene, material = self.world.scene, self.world.material
        spec = mujoco.MjSpec()
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.gravity = scene.gravity
        load = np.zeros(len(self.mass))
        np.add.at(load, self.net.springs, np.repeat(self.stiffness[:, None] * self.stiffer, 2, axis=1))
        omega = np.sqrt(2 * (load / self.mass).max())
        dt = float(min(SAFETY * 2 / omega / (1 + omega * material.damping / 2), LONGEST))
        if scene.times[-1] / dt * max(len(self.mass), 80) > COST:
            raise Runaway(f"steps of {dt:.2g} s")
        if scene.ground is not None:
            # Stiffness and damping of the contact follow the restitution: a damped oscillator of 12 ms.
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_PLANE,
                size=[5, 5, 0.1],
                pos=[0, 0, scene.ground - RADIUS],
                friction=[material.friction, 0, 0],
                contype=1,
                conaffinity=1,
            )
        for k, place in enumerate(self.start):
            body = spec.worldbody.add_body(name=f"p{k}", pos=place)
            for axis in np.eye(3):
                body.add_joint(
                    type=mujoco.mjtJoint.mjJNT_SLIDE,
                    axis=axis,
                    damping=np.array([material.drag_rate * self.mass[k], 0, 0]),
                )
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=[RADIUS, 0, 0],
                mass=self.mass[k],
                contype=1,
                conaffinity=2,
                condim=3,
                friction=[material.friction, 0, 0],
                solref=[max(0.006, 2.2 * dt), max(1.0 - material.restitution, 0.3)],
            )
            body.add_site(name=f"s{k}")
        for k, (i, j) in enumerate(self.net.springs):
            damping = self.stiffness[k] * material.damping
            tendon = spec.add_tendon(
                name=f"t{k}", stiffness=np.array([self.stiffness[k], 0, 0]), damping=np.array([damping, 0, 0])
            )
            tendon.springlength = [self.rest[k], self.rest[k]]
            tendon.wrap_site(f"s{i}")
            tendon.wrap_site(f"s{j}")
        return spec.compile(), dt

    def _hands(self) -> None:
        nodes, anchors = [], []
        effects = {effect.name: effect for effect in self.world.effects}
        late = effects.get("actuation_delay")
        delay = late.amplitude * float(late.options["sign"]) if late else 0.0
        for hand in self.world.scene.hands:
            distance = np.linalg.norm(self.start - hand.place, axis=1)
            held = np.flatnonzero(distance <= max(hand.reach, distance.min() + 1e-6))
            extra = None
            if "hand_torque" in effects:
                torque = effects["hand_torque"]
                t = np.arange(len(hand.offset)) / RATE
                wave = np.sin(2 * np.pi * float(torque.options["rate"]) * t) * np.minimum(t / 0.3, 1)
                extra = torque.amplitude * wave[:, None] * np.asarray(torque.options["axis"])
            nodes.append(held)
            anchors.append(follow(hand, self.start[held], delay, extra))
        self.held = np.concatenate(nodes) if nodes else np.zeros(0, int)
        if not nodes:
            return
        path = np.concatenate(anchors, axis=1)
        load = np.zeros(len(self.mass))
        np.add.at(load, self.net.springs, np.repeat(self.stiffness[:, None], 2, axis=1))
        mass = self.mass[self.held][:, None]
        stiff = mass * (2 * (load / self.mass).max()) / 3
        offset = np.zeros((len(self.held), 3))
        limit, rate = self.slip

        def hold(now: _State) -> Array:
            place = min(now.t * RATE, len(path) - 1.001)
            s = int(place)
            goal = path[s] + (place - s) * (path[s + 1] - path[s]) + offset
            speed = (path[s + 1] - path[s]) * RATE
            pull = stiff * (goal - now.x[self.held])
            if rate > 0:
                size = np.linalg.norm(pull, axis=1, keepdims=True) + 1e-12
                offset[:] -= (
                    np.minimum(rate * now.dt, 0.5 / stiff) * np.maximum(size - limit, 0) * pull / size
                )
            force = np.zeros_like(now.x)
            force[self.held] = pull + 0.6 * np.sqrt(stiff * mass) * (speed - now.v[self.held])
            return force

        self.forces.append(hold)

    def _applied(self, now: _State) -> Array:
        total = np.zeros_like(now.x)
        for force in self.forces:
            total += force(now)
        if self.axial:
            i, j = self.net.springs.T
            way = now.x[j] - now.x[i]
            length = np.linalg.norm(way, axis=1) + 1e-12
            way /= length[:, None]
            strain = length / self.rest - 1
            rate = ((now.v[j] - now.v[i]) * way).sum(axis=1) / self.rest
            tension = sum(law(now, strain, rate, way) for law in self.axial)
            total += self.gather @ (tension[:, None] * way)
        if self.world.scene.ground is not None:
            self.touched += now.dt * (now.x[:, 2] < self.world.scene.ground + 0.001)
        return total

    def _acts(self, effect: Effect, index: Array, weight: Array) -> Array:
        nodes = effect.where(self.net.nodes)
        if effect.name == "grip_slip":
            return held_share(self.world)
        if effect.name in ("adhesion", "static_friction"):
            nodes = np.clip(self.touched / 0.3, 0, 1)
        elif effect.name == "self_collision":
            nodes = np.clip(self.met / 0.1, 0, 1)
        return np.clip(np.einsum("nk,nk->n", nodes[index], weight), 0.0, 1.0)

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

        def law(now: _State, e: Array, rate: Array, way: Array) -> Array:
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

        def law(now: _State, e: Array, rate: Array, way: Array) -> Array:
            spent = np.where(z * rate > 0, np.minimum(np.abs(z) / limit, 3.0) ** sharp, 0.0)
            z[:] += now.dt * rate * (1 - np.minimum(spent, 1.0))
            return where * a * (z - e)

        self.axial.append(law)

    def _damage(self, effect: Effect) -> None:
        where, a, scale = self._where(effect), effect.amplitude, float(effect.options["scale"])
        peak = np.zeros(len(self.rest))

        def law(now: _State, e: Array, rate: Array, way: Array) -> Array:
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

        def bend(now: _State) -> Array:
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

        def bulge(now: _State) -> Array:
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

        def blow(now: _State) -> Array:
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

        def stick(now: _State) -> Array:
            s = np.clip((now.x[:, 2] - ground) / reach, 0, 6)
            force = np.zeros_like(now.x)
            force[:, 2] = -pull * s * np.exp(1 - s) * (s < 6)
            return force

        self.forces.append(stick)

    def _static_friction(self, effect: Effect) -> None:
        ground, slow = self.world.scene.ground, float(effect.options["speed"])
        if ground is None:
            return

        def hold(now: _State) -> Array:
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

        def part(now: _State) -> Array:
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

        def draw(now: _State) -> Array:
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
