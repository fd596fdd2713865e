"""The withheld effects of the finite-element generator: what each asks of the engine.

Amplitudes, in units of the object's own where they have one: `strain_stiffening` relative stiffness added at
the scale strain (power law) or in the exponential's factor (Fung); `tension_only`, `plasticity`, `damage`
shares of the stiffness; `viscoelasticity`, `anisotropy`, `volume_preservation` moduli relative to the base;
`bending_stiffness` relative to weight times length squared; `quadratic_air_drag` coefficient times air
density [kg/m³]; `wind` the same; `moving_base` rad/s; `gravity_tilt`, `magnet` m/s²; `mass_heterogeneity`
relative mass; `grip_slip` m/(N s) relative to the grip; `actuation_delay` s; `adhesion` Pa;
`static_friction` coefficient; `self_collision` m.
"""

import numpy as np

from benchmarks.reality.meshes import Mesh
from benchmarks.reality.world import Array, Effect, World

Numbers = dict[str, float | tuple[float, ...]]
FIELDS = (
    "strain_stiffening",
    "tension_only",
    "viscoelasticity",
    "plasticity",
    "damage",
    "anisotropy",
    "volume_preservation",
    "shrinkage",
)
"""Effects of elements, in the order of `Law` in the engine: each has a place of its own."""


class Laws:
    """Each effect changes the arrays and numbers of a run, by the method of its name."""

    world: World
    body: Mesh
    placed: Array
    middle: Array
    mass: Array
    arrays: dict[str, Array]
    numbers: Numbers
    stiff_factor: float
    """By how much the laws may raise the stiffness of an element, for the time step."""

    # The effects.

    def _shape_field(self, effect: Effect) -> None:
        self.arrays["field"][:, FIELDS.index(effect.name)] = effect.where(self.middle)

    def _strain_stiffening(self, effect: Effect) -> None:
        self._shape_field(effect)
        if effect.options["form"] == 0.0:
            exponent, scale = float(effect.options["exponent"]), float(effect.options["scale"])
            self.numbers |= {"power": effect.amplitude, "power_exponent": exponent, "power_scale": scale}
            self.stiff_factor += effect.amplitude * 2.5**exponent
        else:
            rate = float(effect.options["rate"])
            self.numbers |= {"fung": effect.amplitude, "fung_rate": rate}
            self.stiff_factor += effect.amplitude * (np.exp(3.0) - 1) / rate

    def _tension_only(self, effect: Effect) -> None:
        self._shape_field(effect)
        self.numbers["slack"] = effect.amplitude

    def _viscoelasticity(self, effect: Effect) -> None:
        self._shape_field(effect)
        self.numbers["prony"] = (effect.amplitude / 2, effect.amplitude / 2)
        self.numbers["prony_time"] = (float(effect.options["fast"]), float(effect.options["slow"]))
        self.stiff_factor += effect.amplitude

    def _plasticity(self, effect: Effect) -> None:
        self._shape_field(effect)
        self.numbers |= {
            "hysteresis": effect.amplitude,
            "hysteresis_yield": float(effect.options["yield"]),
            "hysteresis_sharpness": float(effect.options["sharpness"]),
        }

    def _damage(self, effect: Effect) -> None:
        self._shape_field(effect)
        self.numbers |= {"mullins": effect.amplitude, "mullins_scale": float(effect.options["scale"])}

    def _anisotropy(self, effect: Effect) -> None:
        self._shape_field(effect)
        angle = float(effect.options["angle"])
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        if self.body.dim == 3:
            self.arrays["fibre"] = np.tile(way, (len(self.middle), 1))
        else:  # in the frame of each triangle, whose first axis is its first edge
            corners = self.body.nodes[self.body.elements]
            first = corners[:, 1] - corners[:, 0]
            first /= np.linalg.norm(first, axis=1, keepdims=True)
            second = np.cross([0, 0, 1.0], first)
            side = np.sign(np.einsum("nk,nk->n", second, corners[:, 2] - corners[:, 0]))
            self.arrays["fibre"] = np.stack([first @ way, side * (second @ way)], axis=1)
        self.numbers["fibre_stiff"] = effect.amplitude
        self.stiff_factor += effect.amplitude

    def _bending_stiffness(self, effect: Effect) -> None:
        body, length = self.body, self.world.shape.length
        unit = self.world.material.density * 9.81 * length**3
        where = effect.where(
            body.nodes[body.stencil[:, 1]] if body.dim == 1 else body.nodes[body.stencil[:, :2]].mean(axis=1)
        )
        self.arrays["stencil_stiff"] = (
            (self.world.material.bending + effect.amplitude * where) * unit * body.stencil_scale
        )
        rest = np.einsum("sk,skc->sc", body.stencil_weight, body.nodes[body.stencil])
        self.arrays["stencil_rest"] = np.linalg.norm(rest, axis=1)
        self.bent = True

    def _volume_preservation(self, effect: Effect) -> None:
        self._shape_field(effect)
        self.numbers["bulk"] = effect.amplitude
        self.stiff_factor += effect.amplitude

    def _quadratic_air_drag(self, effect: Effect) -> None:
        self.arrays["node_field"] = effect.where(self.body.nodes)
        self.numbers |= {
            "air": effect.amplitude,
            "air_exponent": float(effect.options["exponent"]),
            "air_reference": 1.0,
        }

    def _wind(self, effect: Effect) -> None:
        way = np.asarray(effect.options["direction"]) * float(effect.options["speed"])
        self.numbers |= {
            "air": effect.amplitude / 2,
            "air_exponent": 2.0,
            "air_reference": 1.0,
            "wind": tuple(way),
            "gust": float(effect.options["gust"]),
            "gust_rate": float(effect.options["gust_rate"]),
            "shear": float(effect.options["shear"]),
            "shear_height": 0.3,
        }

    def _gravity_tilt(self, effect: Effect) -> None:
        extra = np.asarray(effect.options["direction"]) * effect.amplitude
        self.numbers["gravity"] = tuple(np.asarray(self.numbers["gravity"]) + extra)

    def _mass_heterogeneity(self, effect: Effect) -> None:
        self.mass = self.mass * (1 + effect.amplitude * effect.where(self.body.nodes))

    def _grip_slip(self, effect: Effect) -> None:
        weight = float(self.mass.sum()) * 9.81 / max(len(self.arrays["grip_node"]), 1)
        self.numbers |= {
            "slip_force": float(effect.options["threshold"]) * weight,
            "slip_rate": effect.amplitude * 0.05 / weight,
        }

    def _actuation_delay(self, effect: Effect) -> None:
        """Done where the hands are made."""

    def _hand_torque(self, effect: Effect) -> None:
        """Done where the hands are made."""

    def _adhesion(self, effect: Effect) -> None:
        self.numbers |= {"adhesion": effect.amplitude, "adhesion_range": float(effect.options["range"])}

    def _static_friction(self, effect: Effect) -> None:
        self.numbers |= {"stribeck": effect.amplitude, "stribeck_speed": float(effect.options["speed"])}

    def _self_collision(self, effect: Effect) -> None:
        self.numbers["contact_radius"] = effect.amplitude

    # From outside of the catalogue.

    def _magnet(self, effect: Effect) -> None:
        aside, along, high = (float(effect.options[key]) for key in ("aside", "along", "high"))
        x, y, _ = self.world.scene.shift
        self.numbers |= {
            "magnet": effect.amplitude,
            "magnet_exponent": float(effect.options["exponent"]),
            "magnet_soft": 0.06,
            "magnet_place": (float(x) + aside, float(y) + along, high),
        }

    def _shrinkage(self, effect: Effect) -> None:
        self._shape_field(effect)
        strain = effect.amplitude * float(effect.options["sign"])
        self.numbers |= {"swelling": strain, "swelling_time": float(self.world.scene.times[-1])}

    def _moving_base(self, effect: Effect) -> None:
        spin = np.asarray(effect.options["axis"]) * effect.amplitude
        self.numbers |= {"spin": tuple(spin), "spin_centre": tuple(self.world.scene.shift)}

    def _stick_patch(self, effect: Effect) -> None:
        self.arrays["node_field"] = effect.where(self.body.nodes)
        self.numbers |= {"tether": effect.amplitude, "tether_damping": float(np.sqrt(effect.amplitude)) * 0.2}
        self.stiff_factor += effect.amplitude / self._frequency() ** 2

    def _buoyancy(self, effect: Effect) -> None:
        # Nothing rests at z = 0 when it hangs: the surface is then below where it starts.
        height = float(effect.options["height"]) - (0.4 if self.world.scene.ground is None else 0.0)
        self.numbers |= {"buoyancy": effect.amplitude, "water_height": height, "water_band": 0.1}
