"""A simulator's springs in MuJoCo: three sliding joints per point, a tendon between two sites per spring.

For the comparison in kernel.py, and for the tests of parity. MuJoCo computes in float64 and has no gradient
of a step but by finite differences. What maps onto what:

- point: a body on three slide joints; drag of rate r: joint damping m (exp(r dt) - 1) / dt, which MuJoCo's
  Euler step takes implicitly, so that velocities shrink by exactly exp(-r dt);
- spring: a spatial tendon of two sites with stiffness, damping and rest length;
- controller: such a body too, put to its place and velocity before each step. A mocap body would do for the
  place, but MuJoCo gives it no velocity for the dashpot to see;
- ground: a plane and a sphere per point, a soft contact (`soft_contact`).
"""

import cmath
import math

import mujoco
import numpy as np
from springs import springs

from model.simulator.simulator import Simulator
from model.simulator.system import Anchors

RADIUS = 1e-3
"""Of the spheres that touch the ground [m]; the plane lies as much lower."""
HARD = "0.001 0.001 0.001"
"""Impedance of a contact that is a spring and a damper: with a harder one, slip would lift what slips."""


class MujocoSprings:
    """The system of a simulator, stepped by MuJoCo.

    Args:
        simulator: Linear springs, one dashpot, one drag rate, gravity, perhaps a ground.
        dt: Substep [s].
        impact: Time constant of the contact with the ground [s], where there is one.
    """

    def __init__(self, simulator: Simulator, dt: float, impact: float = 0.0) -> None:
        """See the class."""
        system = simulator.system
        self.model = mujoco.MjModel.from_xml_string(_document(simulator, dt, impact))
        self.data = mujoco.MjData(self.model)
        self.count, self.held = len(system.points), system.controller_count
        self.rest = system.points.double().numpy()
        self.hands = np.zeros((0, 3)) if not self.held else system.controller_points.double().numpy()

    def set(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Points at `positions` [m] with `velocities` [m/s], [N, 3]."""
        size = 3 * self.count
        self.data.qpos[:size] = (positions - self.rest).ravel()
        self.data.qvel[:size] = velocities.ravel()

    def step(self, anchors: Anchors | None = None) -> None:
        """One substep, with the controllers at `anchors`; None: where they rest."""
        if self.held:
            moved = 0.0 if anchors is None else anchors.positions.numpy() - self.hands
            speed = 0.0 if anchors is None else anchors.velocities.numpy()
            self.data.qpos[3 * self.count :] = np.broadcast_to(moved, self.hands.shape).ravel()
            self.data.qvel[3 * self.count :] = np.broadcast_to(speed, self.hands.shape).ravel()
        mujoco.mj_step(self.model, self.data)

    @property
    def positions(self) -> np.ndarray:
        """[m], [N, 3]."""
        return self.rest + self.data.qpos[: 3 * self.count].reshape(-1, 3)

    @property
    def velocities(self) -> np.ndarray:
        """[m/s], [N, 3]."""
        return self.data.qvel[: 3 * self.count].reshape(-1, 3).copy()


def soft_contact(restitution: float, impact: float) -> tuple[float, float]:
    r"""Stiffness ω² [1/s²] and damping 2ζω [1/s], each per mass, of a contact with that restitution.

    A mass that meets a spring and a damper and leaves when they push no more keeps
    $e = \exp(-2\zeta\,\arccos(\zeta)/\sqrt{1-\zeta^2})$ of its speed; $\omega$ is 1/`impact`. Above
    $\zeta = 1$, root and arc are imaginary and the formula is the same.

    Reference:
        Schwager and Pöschel (2007), Coefficient of restitution and linear-dashpot model revisited, Granular
        Matter 9, 465.
    """

    def kept(ratio: float) -> float:
        return math.exp(-2 * ratio * abs(cmath.acos(ratio) / cmath.sqrt(1 - ratio**2)))

    low, high = 0.0, 20.0
    for _ in range(60):
        ratio = (low + high) / 2
        low, high = (ratio, high) if kept(ratio) > restitution else (low, ratio)
    return 1 / impact**2, 2 * low / impact


def _document(simulator: Simulator, dt: float, impact: float) -> str:
    """The model as MuJoCo reads it."""
    system, held = simulator.system, simulator.system.controller_count
    falls, dragged = "gravity" in simulator.forces, "drag" in simulator.forces
    gravity = simulator.force("gravity").value("gravity").tolist() if falls else [0.0] * 3
    rate = float(simulator.force("drag").value("drag_rate")) if dragged else 0.0
    plane, pairs = _ground(simulator, dt, impact) if "ground" in simulator.contacts else ("", [])
    places, mass = system.points.double().tolist(), system.value("mass").expand(len(system.points)).tolist()
    bodies = [
        _body(f"p{i}", place, m, m * math.expm1(rate * dt) / dt)
        for i, (place, m) in enumerate(zip(places, mass, strict=True))
    ]
    hands = system.controller_points.double().tolist() if held else []
    bodies += [_body(f"c{i}", place, 1.0, 0.0) for i, place in enumerate(hands)]
    return "\n".join([
        f'<mujoco><option timestep="{dt!r}" integrator="Euler" gravity="{_row(gravity)}" cone="elliptic"',
        f' impratio="1e7" jacobian="sparse" tolerance="1e-14"><flag contact="{_able(plane)}"/></option>',
        '<size memory="256M"/><default><joint type="slide"/></default>',
        f"<worldbody>{plane}", *bodies, "</worldbody><tendon>", *_tendons(simulator), "</tendon>",
        "<contact>", *pairs, "</contact></mujoco>",
    ])  # fmt: skip


def _ground(simulator: Simulator, dt: float, impact: float) -> tuple[str, list[str]]:
    """The plane, and its pairing with every point.

    Friction works against slip by damping; the strongest that a step takes, 1/dt, leaves Coulomb's law alone.
    """
    ground = simulator.contact("ground")
    friction, restitution, height = (float(ground.value(n)) for n in ("friction", "restitution", "height"))
    stiff, damped = soft_contact(restitution, impact)
    law = f'condim="3" friction="{friction!r} {friction!r}" solimp="{HARD}"'
    law += f' solref="{-stiff!r} {-damped!r}" solreffriction="-1 {-0.001 / dt!r}"'
    still = 'contype="0" conaffinity="0"'
    plane = f'<geom name="ground" type="plane" size="0 0 1" pos="0 0 {height - RADIUS!r}" {still}/>'
    count = len(simulator.system.points)
    return plane, [f'<pair geom1="ground" geom2="p{i}" {law}/>' for i in range(count)]


def _body(name: str, place: list[float], mass: float, damping: float) -> str:
    joints = "".join(f'<joint axis="{axis}" damping="{damping!r}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    ball = f'<geom name="{name}" size="{RADIUS}" mass="0" contype="0" conaffinity="0"/>'
    return (
        f'<body pos="{_row(place)}"><inertial pos="0 0 0" mass="{mass!r}" diaginertia="1 1 1"/>{joints}'
        f'<site name="{name}"/>{ball}</body>'
    )


def _tendons(simulator: Simulator) -> list[str]:
    """One per edge."""
    edges = simulator.system.edges
    stiffness, lengths, damping = springs(simulator)
    names = [f"p{i}" for i in range(edges.point_count)]
    names += [f"c{i}" for i in range(simulator.system.controller_count)]
    each = zip(edges.first.tolist(), edges.second.tolist(), stiffness, lengths, strict=True)
    return [
        f'<spatial stiffness="{k!r}" damping="{damping!r}" springlength="{rest!r}">'
        f'<site site="{names[i]}"/><site site="{names[j]}"/></spatial>'
        for i, j, k, rest in each
    ]


def _row(values: list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _able(what: str) -> str:
    return "enable" if what else "disable"
