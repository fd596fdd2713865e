"""The finite-element generator: worlds moved by `engine.cpp`; the effects are in `fem_laws.py`."""

import ctypes

import numpy as np

from benchmarks.reality.compiled import Engine
from benchmarks.reality.fem_laws import FIELDS, Laws, Numbers
from benchmarks.reality.hands import follow, held_share
from benchmarks.reality.meshes import Mesh, mesh
from benchmarks.reality.skin import attach, carry
from benchmarks.reality.world import RATE, Array, Effect, Motion, Runaway, World

ENGINE = Engine("engine.cpp")
SAFETY = 0.7
COST = 8e7
"""Elements times steps, beyond which nobody waits."""


def simulate(world: World) -> Motion:
    """Move a world.

    Raises:
        Runaway: it left the finite numbers.
    """
    body = mesh(world.shape, world.spacing, world.mesh_seed)
    return _Run(world, body).result()


class _Run(Laws):
    """One simulation: arrays and numbers of the engine, changed by each effect in turn."""

    def __init__(self, world: World, body: Mesh) -> None:
        self.world, self.body = world, body
        self.placed = body.nodes @ world.scene.turn.T + world.scene.shift
        self.middle = body.nodes[body.elements].mean(axis=1)
        self.stiff_factor = 1.0
        self.numbers: Numbers = {"ground": np.nan if world.scene.ground is None else world.scene.ground}
        self.mass = self._mass()
        self.arrays: dict[str, Array] = {}
        self._elastic()
        self._hands()
        count, scene = len(body.nodes), world.scene
        self.arrays |= {
            "rest": body.nodes,
            "start": self.placed,
            "corner": body.elements,
            "stencil": body.stencil,
            "stencil_weight": body.stencil_weight,
            "stencil_stiff": np.zeros(len(body.stencil)),
            "stencil_rest": np.zeros(len(body.stencil)),
            "face": body.faces,
            "node_area": body.node_area,
            "times": scene.times,
            "field": np.zeros((len(body.elements), len(FIELDS))),
            "node_field": np.ones(count),
            "fibre": np.tile(np.eye(body.dim)[0], (len(body.elements), 1)),
            "out": np.zeros((len(scene.times), count, 3)),
            "energy": np.zeros((len(scene.times), 4)),
            "touched": np.zeros(count),
            "met": np.zeros(count),
            "slipped": np.zeros(max(len(self.arrays["grip_node"]), 1)),
        }
        material = world.material
        if material.bending > 0 and not any(e.name == "bending_stiffness" for e in world.effects):
            self._bending_stiffness(Effect("bending_stiffness", 0.0))
        self.numbers |= {
            "gravity": tuple(scene.gravity),
            "drag_rate": material.drag_rate,
            "friction": material.friction,
            "restitution": material.restitution,
            "anchor_rate": RATE,
        }
        for effect in world.effects:
            getattr(self, f"_{effect.name}")(effect)

    def result(self) -> Motion:
        """Run, and see what the observed points did."""
        self.arrays["mass"] = self.mass
        step = self._step()
        if "contact_radius" in self.numbers:
            self.numbers["contact_stiff"] = float(np.median(self.mass)) * (0.5 / step) ** 2
        self.numbers |= {
            "step": step,
            "nodes": len(self.mass),
            "dim": self.body.dim,
            "elements": len(self.body.elements),
            "stencils": len(self.body.stencil) if "bent" in self.__dict__ else 0,
            "grips": len(self.arrays["grip_node"]),
            "frames": len(self.world.scene.times),
            "samples": self.arrays["anchor"].shape[0],
            "faces": len(self.body.faces),
        }
        if self.world.scene.times[-1] / step * max(len(self.body.elements), 200) > COST:
            raise Runaway(f"too stiff: steps of {step:.2g} s")
        failed = ENGINE.library.simulate(ctypes.byref(ENGINE.problem(self.arrays, self.numbers)))
        if failed:
            raise Runaway(f"frame {failed - 1}")
        index, weight = attach(self.world.shape.surface, self.body.nodes, 4 if self.body.dim == 1 else 8)
        nodes = self.arrays["out"]
        acts = {effect.name: self._acts(effect, index, weight) for effect in self.world.effects}
        return Motion(carry(nodes, index, weight), acts, nodes, self.arrays["energy"])

    # What every world has.

    def _mass(self) -> Array:
        body = self.body
        mass = np.zeros(len(body.nodes))
        share = self.world.material.density * body.measure / (body.dim + 1)
        np.add.at(mass, body.elements, np.repeat(share[:, None], body.dim + 1, axis=1))
        return mass

    def _elastic(self) -> None:
        material, body = self.world.material, self.body
        low, high = material.stiffness
        middle = self.world.shape.surface.mean(axis=0)
        blend = 1 / (
            1 + np.exp(-np.clip((self.middle - middle)[:, 0] / (0.05 * self.world.shape.length), -40, 40))
        )
        young = low * (1 - blend) + high * blend
        nu = material.poisson
        self.arrays |= {
            "mu": young / 2 if body.dim == 1 else young / (2 * (1 + nu)),
            "lambda": [
                np.zeros_like(young),
                young * nu / (1 - nu**2),
                young * nu / ((1 + nu) * (1 - 2 * nu)),
            ][body.dim - 1],
            "eta": young * material.damping,
        }

    def _hands(self) -> None:
        nodes, stiff, anchors = [], [], []
        delay = sum(
            e.amplitude * float(e.options["sign"]) for e in self.world.effects if e.name == "actuation_delay"
        )
        for hand in self.world.scene.hands:
            distance = np.linalg.norm(self.placed - hand.place, axis=1)
            held = np.flatnonzero(distance <= max(hand.reach, distance.min() + 1e-6))
            extra = self._hidden_turn(hand.offset)
            anchors.append(follow(hand, self.placed[held], delay, extra))
            nodes.append(held)
        samples = int(np.ceil(self.world.scene.times[-1] * RATE)) + 2
        self.arrays["grip_node"] = np.concatenate(nodes) if nodes else np.zeros(0, int)
        self.arrays["anchor"] = np.concatenate(anchors, axis=1) if anchors else np.zeros((samples, 0, 3))
        omega = self._frequency() / 1.5
        stiff = self.mass[self.arrays["grip_node"]] * omega**2
        self.arrays["grip_stiff"] = stiff

    def _hidden_turn(self, offset: Array) -> Array | None:
        torque = next((e for e in self.world.effects if e.name == "hand_torque"), None)
        if torque is None:
            return None
        t = np.arange(len(offset)) / RATE
        rate, axis = float(torque.options["rate"]), np.asarray(torque.options["axis"])
        return (
            torque.amplitude * np.sin(2 * np.pi * rate * t)[:, None] * axis * np.clip(t / 0.3, 0, 1)[:, None]
        )

    def _frequency(self) -> float:
        """Bound of the highest frequency [1/s], by the highest of any element (Fried 1972)."""
        body = self.body
        corners = body.nodes[body.elements]
        edges = corners[:, 1:] - corners[:, :1]
        gram = np.linalg.inv(edges @ edges.transpose(0, 2, 1))
        inner = np.concatenate([-np.ones((1, body.dim)), np.eye(body.dim)])
        largest = np.linalg.eigvalsh(inner @ gram @ inner.T)[:, -1]
        wave = (self.arrays["lambda"] + 2 * self.arrays["mu"]) * (body.dim + 1) / self.world.material.density
        return float(np.sqrt((wave * largest).max()))

    def _step(self) -> float:
        omega = self._frequency() * np.sqrt(self.stiff_factor)
        bent = self.arrays["stencil_stiff"]
        if bent.any():
            squares = (self.body.stencil_weight**2).sum(axis=1)
            load = np.zeros(len(self.mass))
            np.add.at(load, self.body.stencil, np.repeat((bent * squares)[:, None], 4, axis=1))
            omega = float(np.hypot(omega, np.sqrt((load / self.mass).max() * 1.5)))
        ratio = omega * self.world.material.damping / 2
        return float(SAFETY * 2 / omega * (np.sqrt(1 + ratio**2) - ratio))

    def _acts(self, effect: Effect, index: Array, weight: Array) -> Array:
        """Where the effect acted, at the observed points."""
        nodes = effect.where(self.body.nodes)
        if effect.name == "grip_slip":
            return held_share(self.world)
        if effect.name in ("adhesion", "static_friction"):
            nodes = np.clip(self.arrays["touched"] / 0.3, 0, 1)
        elif effect.name == "self_collision":
            nodes = np.clip(self.arrays["met"] / 0.1, 0, 1)
        return np.clip(np.einsum("nk,nk->n", nodes[index], weight), 0.0, 1.0)
