"""The withheld effects of the MuJoCo generator: what each asks of `particles.cpp`.

Amplitudes mean what they mean in `fem_laws.py`; the laws are those of springs, particles and cells.
"""

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import Delaunay

from benchmarks.reality.nets import Lattice
from benchmarks.reality.world import Array, Effect, World

Numbers = dict[str, float | tuple[float, ...]]


class Laws:
    """Each effect adds its arrays and numbers to those of a run, by the method of its name."""

    world: World
    net: Lattice
    start: Array
    mass: Array
    rest: Array
    stiffness: Array
    stiffer: float
    """By how much the laws may raise the stiffness of a spring, for the time step."""
    gravity: Array
    arrays: dict[str, Array]
    numbers: Numbers

    # Effects along springs: tensions [e] in N.

    def _where(self, effect: Effect) -> Array:
        where = effect.where(self.net.nodes[self.net.springs].mean(axis=1))
        return where * self.stiffness * self.rest

    def _strain_stiffening(self, effect: Effect) -> None:
        a, options = effect.amplitude, effect.options
        if options["form"] == 0.0:
            p = float(options["exponent"])
            self.arrays["power"] = self._where(effect) * a
            self.numbers |= {"power_exponent": p, "power_scale": float(options["scale"])}
            self.stiffer += a * 2.5**p
        else:
            r = float(options["rate"])
            self.arrays["fung"] = self._where(effect) * a
            self.numbers["fung_rate"] = r
            self.stiffer += a / r * float(np.expm1(3.0))

    def _tension_only(self, effect: Effect) -> None:
        self.arrays["slack"] = self._where(effect) * effect.amplitude

    def _viscoelasticity(self, effect: Effect) -> None:
        self.arrays["prony"] = self._where(effect) * effect.amplitude / 2
        self.numbers["prony_time"] = (float(effect.options["fast"]), float(effect.options["slow"]))
        self.stiffer += effect.amplitude

    def _plasticity(self, effect: Effect) -> None:
        self.arrays["hysteresis"] = self._where(effect) * effect.amplitude
        self.numbers |= {
            "yield": float(effect.options["yield"]),
            "sharpness": float(effect.options["sharpness"]),
        }

    def _damage(self, effect: Effect) -> None:
        self.arrays["mullins"] = self._where(effect) * effect.amplitude
        self.numbers["mullins_scale"] = float(effect.options["scale"])

    def _anisotropy(self, effect: Effect) -> None:
        angle = float(effect.options["angle"])
        rest = self.net.nodes[self.net.springs[:, 1]] - self.net.nodes[self.net.springs[:, 0]]
        along = (rest / self.rest[:, None]) @ [np.cos(angle), np.sin(angle), 0.0]
        self.arrays["fibre"] = self._where(effect) * along**4 * effect.amplitude
        self.stiffer += effect.amplitude

    def _shrinkage(self, effect: Effect) -> None:
        self.arrays["swelling"] = self._where(effect) * effect.amplitude * float(effect.options["sign"])
        self.numbers["swelling_time"] = float(self.world.scene.times[-1])

    # Effects on particles and cells.

    def _bending_stiffness(self, effect: Effect) -> None:
        a, b, c = self.net.triplets.T
        nodes, length = self.net.nodes, self.world.shape.length
        left = np.linalg.norm(nodes[b] - nodes[a], axis=1)
        right = np.linalg.norm(nodes[c] - nodes[b], axis=1)
        unit = self.world.material.density * 9.81 * length**3
        wide = 2 / (left + right) if self.world.shape.kind == "rope" else np.ones(len(a))
        relative = self.world.material.bending + effect.amplitude * effect.where(nodes[b])
        weight = np.stack([1 / left, -1 / left - 1 / right, 1 / right], axis=1)
        curve = np.einsum("bk,bkc->bc", weight, nodes[self.net.triplets])
        self.arrays |= {
            "bend": self.net.triplets,
            "bend_weight": weight,
            "bend_stiff": unit * wide * relative,
            "bend_rest": np.linalg.norm(curve, axis=1),
        }

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
        young = np.mean(self.world.material.stiffness) * 1.2
        self.arrays |= {
            "cell": cells,
            "cell_volume": np.abs(volume),
            "cell_stiff": effect.amplitude * young * effect.where(nodes[cells].mean(axis=1)),
        }
        self.stiffer += effect.amplitude * 2

    def _quadratic_air_drag(self, effect: Effect) -> None:
        self.arrays["air"] = effect.amplitude * self.net.area * effect.where(self.net.nodes)
        self.numbers["air_exponent"] = float(effect.options["exponent"])

    def _wind(self, effect: Effect) -> None:
        o = effect.options
        self.arrays["blown"] = 0.5 * effect.amplitude * self.net.area
        self.numbers |= {
            "wind": tuple(np.asarray(o["direction"]) * float(o["speed"])),
            "gust": float(o["gust"]),
            "gust_rate": float(o["gust_rate"]),
            "shear": float(o["shear"]),
        }

    def _gravity_tilt(self, effect: Effect) -> None:
        self.gravity = self.gravity + np.asarray(effect.options["direction"]) * effect.amplitude

    def _mass_heterogeneity(self, effect: Effect) -> None:
        self.mass = self.mass * (1 + effect.amplitude * effect.where(self.net.nodes))

    def _grip_slip(self, effect: Effect) -> None:
        held = sum(
            max(int((np.linalg.norm(self.start - hand.place, axis=1) <= hand.reach).sum()), 1)
            for hand in self.world.scene.hands
        )
        weight = float(self.mass.sum()) * 9.81 / max(held, 1)
        self.numbers |= {
            "slip_force": float(effect.options["threshold"]) * weight,
            "slip_rate": effect.amplitude * 0.05 / weight,
        }

    def _actuation_delay(self, effect: Effect) -> None:
        """Done where the hands are made."""

    def _hand_torque(self, effect: Effect) -> None:
        """Done where the hands are made."""

    def _adhesion(self, effect: Effect) -> None:
        area = self.net.area
        self.arrays["stuck"] = effect.amplitude * np.maximum(area, area[area > 0].min())
        self.numbers["adhesion_range"] = float(effect.options["range"])

    def _static_friction(self, effect: Effect) -> None:
        self.numbers |= {
            "stribeck": effect.amplitude,
            "stribeck_speed": float(effect.options["speed"]),
        }

    def _self_collision(self, effect: Effect) -> None:
        self.numbers |= {
            "contact_radius": effect.amplitude,
            "contact_stiff": float(np.median(self.load())),
        }

    def _magnet(self, effect: Effect) -> None:
        o = effect.options
        x, y, _ = self.world.scene.shift
        self.numbers |= {
            "magnet": effect.amplitude,
            "magnet_exponent": float(o["exponent"]),
            "magnet_place": (x + float(o["aside"]), y + float(o["along"]), float(o["high"])),
        }

    def _moving_base(self, effect: Effect) -> None:
        self.numbers |= {
            "spin": tuple(np.asarray(effect.options["axis"]) * effect.amplitude),
            "spin_centre": tuple(self.world.scene.shift),
        }

    def _stick_patch(self, effect: Effect) -> None:
        self.arrays["tether"] = self.mass * effect.amplitude * effect.where(self.net.nodes)
        self.numbers["tether_damping"] = 0.2 / float(np.sqrt(effect.amplitude))

    def _buoyancy(self, effect: Effect) -> None:
        low = 0.4 if self.world.scene.ground is None else 0.0
        self.numbers |= {
            "buoyancy": effect.amplitude,
            "water_height": float(effect.options["height"]) - low,
        }

    # What they need.

    def load(self) -> Array:
        """Stiffness of all springs at each node [n] N/m."""
        load = np.zeros(len(self.mass))
        np.add.at(load, self.net.springs, np.repeat(self.stiffness[:, None], 2, axis=1))
        return load

    def frequency(self) -> float:
        """Highest frequency [1/s] of springs, hands and bending at rest, by power iteration."""
        i, j = self.net.springs.T
        way = (self.net.nodes[j] - self.net.nodes[i]) / self.rest[:, None]
        count, row = len(self.mass), np.arange(len(i))
        spread = csr_matrix(
            (np.repeat([1.0, -1.0], len(i)), (np.tile(row, 2), np.concatenate([j, i]))), (len(i), count)
        )
        bends = self.arrays.get("bend")
        if bends is not None:
            rows = np.repeat(np.arange(len(bends)), 3)
            curve = csr_matrix(
                (self.arrays["bend_weight"].ravel(), (rows, bends.ravel())), (len(bends), count)
            )
        held = np.zeros((count, 1))
        np.add.at(held[:, 0], self.arrays["grip_node"], self.arrays["grip_stiff"])
        root = np.sqrt(self.mass)[:, None]
        stiff = (self.stiffness * self.stiffer)[:, None]
        vector = np.random.default_rng(0).normal(size=(count, 3))
        largest = 0.0
        for _ in range(80):
            vector /= np.linalg.norm(vector)
            moved = vector / root
            stretch = ((spread @ moved) * way).sum(axis=1, keepdims=True)
            force = spread.T @ (stiff * stretch * way) + held * moved
            if bends is not None:
                force += curve.T @ (self.arrays["bend_stiff"][:, None] * (curve @ moved))
            vector = force / root
            largest = float(np.linalg.norm(vector))
        return float(np.sqrt(1.1 * largest))
