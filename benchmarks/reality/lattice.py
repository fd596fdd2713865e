"""The MuJoCo generator: particles on another lattice, its own integrator and contacts.

Particles are bodies with three slide joints, whose damping is the drag; the ground is MuJoCo's plane with an
elliptic friction cone. Springs, hands and withheld effects are applied forces of `particles.cpp`, which also
takes MuJoCo's steps (tendons as springs, and forces in numpy, took ten times as long). Amplitudes mean what
they mean in `fem.py`, the laws are those of springs.
"""

import ctypes
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.reality.compiled import Engine
from benchmarks.reality.hands import follow, held_share
from benchmarks.reality.lattice_laws import Laws
from benchmarks.reality.nets import Lattice, lattice
from benchmarks.reality.skin import attach, carry
from benchmarks.reality.world import RATE, Array, Effect, Motion, Runaway, World

ENGINE = Engine("particles.cpp")
OFF = mujoco.mjtDisableBit
RADIUS = 0.003
SAFETY = 0.8
LONGEST = 0.002
COST = 6e6
"""Steps times particles, beyond which nobody waits."""


def simulate(world: World) -> Motion:
    """Move a world.

    Raises:
        Runaway: it left the finite numbers, or would need too many steps.
    """
    return Run(world, lattice(world.shape, world.spacing, world.mesh_seed)).result()


@cache
def _step() -> ctypes.c_void_p:
    """MuJoCo's `mj_step`, out of the library that its Python package has loaded."""
    (path,) = Path(mujoco.__file__).parent.glob("libmujoco.so*")
    return ctypes.cast(ctypes.CDLL(str(path)).mj_step, ctypes.c_void_p)


class Run(Laws):
    """One simulation: arrays and numbers for `particles.cpp`, changed by each effect in turn."""

    def __init__(self, world: World, net: Lattice) -> None:
        """What moves, and what moves it; every effect in its turn."""
        self.world, self.net = world, net
        scene, material = world.scene, world.material
        self.start = net.nodes @ scene.turn.T + scene.shift
        self.mass = material.density * net.share
        self.gravity = np.asarray(scene.gravity)
        self.rest = np.linalg.norm(net.nodes[net.springs[:, 1]] - net.nodes[net.springs[:, 0]], axis=1)
        low, high = material.stiffness
        middle = net.nodes[net.springs].mean(axis=1) - world.shape.surface.mean(axis=0)
        blend = 1 / (1 + np.exp(-np.clip(middle[:, 0] / (0.05 * world.shape.length), -40, 40)))
        self.stiffness = net.unit * (low * (1 - blend) + high * blend)
        self.stiffer = 1.0
        self.numbers = {"ground": np.nan if scene.ground is None else scene.ground, "anchor_rate": RATE}
        self.arrays = {
            "start": self.start,
            "rest_place": net.nodes,
            "spring": net.springs,
            "rest": self.rest,
            "stiffness": self.stiffness,
            "damping": self.stiffness * material.damping,
            "memory": np.zeros((len(self.rest), 4)),
            "touched": np.zeros(len(self.mass)),
            "met": np.zeros(len(self.mass)),
        }
        if material.bending > 0 and not any(e.name == "bending_stiffness" for e in world.effects):
            self._bending_stiffness(Effect("bending_stiffness", 0.0))
        for effect in world.effects:
            getattr(self, f"_{effect.name}")(effect)
        self.arrays["mass"] = self.mass
        self._hands()

    def result(self) -> Motion:
        """Run, and see what the observed points did."""
        model, dt = self._model()
        data = mujoco.MjData(model)
        times, frames = self.world.scene.times, [self.start]
        problem, enabled = self._problem(model, data), model.opt.disableflags
        for frame in range(1, len(times)):
            span = float(times[frame] - times[frame - 1])
            steps = max(int(np.ceil(span / dt)), 1)
            model.opt.timestep = span / steps
            model.opt.disableflags = enabled | (0 if self._low(data, span) else int(OFF.mjDSBL_CONTACT))
            ENGINE.library.advance(
                ctypes.byref(problem),
                _step(),
                ctypes.c_int32(steps),
                ctypes.c_double(times[frame - 1]),
                ctypes.c_double(span / steps),
            )
            frames.append(data.qpos.reshape(-1, 3) + self.start)
            lost = not np.isfinite(frames[-1]).all() or np.abs(data.qpos).max() > 20
            if lost or any(w.number for w in data.warning):
                raise Runaway(f"frame {frame}")
        nodes = np.stack(frames)
        kind = self.world.shape.kind
        index, weight = attach(self.world.shape.surface, self.net.nodes, 4 if kind == "rope" else 8)
        acts = {effect.name: self._acts(effect, index, weight) for effect in self.world.effects}
        return Motion(carry(nodes, index, weight), acts, nodes, np.zeros((0, 4)))

    def _low(self, data: mujoco.MjData, span: float) -> bool:
        """Whether any particle could touch the ground before `span` [s] is over."""
        if self.world.scene.ground is None:
            return False
        fall = np.linalg.norm(data.qvel.reshape(-1, 3), axis=1) * span + 20.0 * span**2
        height = data.qpos[2::3] + self.start[:, 2] - self.world.scene.ground
        return bool((height < fall + 2 * RADIUS).any())

    def _problem(self, model: mujoco.MjModel, data: mujoco.MjData) -> ctypes.Structure:
        self.arrays |= {"position": data.qpos, "velocity": data.qvel, "applied": data.qfrc_applied}
        counts = {
            "nodes": len(self.mass),
            "springs": len(self.rest),
            "bends": len(self.arrays.get("bend", ())),
            "cells": len(self.arrays.get("cell", ())),
            "grips": len(self.arrays["grip_node"]),
            "samples": len(self.arrays["anchor"]),
        }
        vectors = {"gravity": tuple(self.gravity)}
        problem = ENGINE.problem(self.arrays, {**self.numbers, **counts, **vectors})
        problem.model, problem.data = model._address, data._address
        return problem

    def _model(self) -> tuple[mujoco.MjModel, float]:
        scene, material = self.world.scene, self.world.material
        spec = mujoco.MjSpec()
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.solver = mujoco.mjtSolver.mjSOL_CG  # contacts of particles are apart: Newton's is dearer
        # Drag is weak enough to be explicit; to look for islands among particles takes longer than it saves.
        spec.option.disableflags = int(OFF.mjDSBL_EULERDAMP | OFF.mjDSBL_ISLAND)
        spec.option.gravity = self.gravity
        omega = self.frequency()
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
        self.particles(spec, dt)
        self.elastic(spec)
        return spec.compile(), dt

    def particles(self, spec: mujoco.MjSpec, dt: float) -> None:
        """Add them: bodies that slide three ways, in contacts no stiffer than steps of `dt` [s] allow."""
        material = self.world.material
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

    def elastic(self, spec: mujoco.MjSpec) -> None:
        """Add what MuJoCo itself holds together: of a lattice nothing, its springs are `particles.cpp`'s."""

    def _hands(self) -> None:
        nodes, anchors = [np.zeros(0, int)], []
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
        held = np.concatenate(nodes)
        mass = self.mass[held]
        stiff = mass * 2 * (self.load() / self.mass).max() / 3
        self.arrays |= {
            "grip_node": held,
            "anchor": np.concatenate(anchors, axis=1) if anchors else np.zeros((2, 0, 3)),
            "grip_stiff": stiff,
            "grip_damping": 0.6 * np.sqrt(stiff * mass),
            "slip": np.zeros((len(held), 3)),
        }

    def _acts(self, effect: Effect, index: Array, weight: Array) -> Array:
        nodes = effect.where(self.net.nodes)
        if effect.name == "grip_slip":
            return held_share(self.world)
        if effect.name in ("adhesion", "static_friction"):
            nodes = np.clip(self.arrays["touched"] / 0.3, 0, 1)
        elif effect.name == "self_collision":
            nodes = np.clip(self.arrays["met"] / 0.1, 0, 1)
        return np.clip(np.einsum("nk,nk->n", nodes[index], weight), 0.0, 1.0)
