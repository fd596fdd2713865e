"""The MuJoCo generator: particles on another lattice, tendons as springs, its own integrator and contacts.

Particles are bodies with three slide joints; each spring is a spatial tendon with stiffness and damping; the
ground is MuJoCo's plane with an elliptic friction cone. Hands and withheld effects are applied forces,
written in numpy over springs, particles or cells. Amplitudes mean what they mean in `fem.py`, the laws are
those of springs.
"""

import mujoco
import numpy as np
from scipy.sparse import csr_matrix

from benchmarks.reality.hands import follow, held_share
from benchmarks.reality.lattice_laws import Force, Law, Laws, State
from benchmarks.reality.nets import Lattice, lattice
from benchmarks.reality.skin import attach, carry
from benchmarks.reality.world import RATE, Array, Effect, Motion, Runaway, World

RADIUS = 0.003
SAFETY = 0.75
LONGEST = 0.002
COST = 9e6
"""Steps times particles, beyond which nobody waits."""


def simulate(world: World) -> Motion:
    """Move a world.

    Raises:
        Runaway: it left the finite numbers, or would need too many steps.
    """
    return _Run(world, lattice(world.shape, world.spacing, world.mesh_seed)).result()


class _Run(Laws):
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
        self.axial: list[Law] = []
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
                now = State(
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
        # Semi-implicit Euler with explicit damping is stable below dt²ω² + 2 dt ω²τ = 4.
        ratio = omega * material.damping / 2
        dt = float(min(SAFETY * 2 / omega * (np.sqrt(1 + ratio**2) - ratio), LONGEST))
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

        def hold(now: State) -> Array:
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

    def _applied(self, now: State) -> Array:
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
