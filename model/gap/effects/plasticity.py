"""A material that does not come back."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from jaxtyping import Int

from model.gap.effects.base import (
    Effect,
    Field,
    Grid,
    Quantity,
    Values,
    borne,
    no_springs,
    on_points,
    on_springs,
    slackness_of,
    spring_stiffness,
)
from model.gap.effects.plastic_bending import PlasticBending
from model.gap.world import World
from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.parameters import Constant, TensorLike
from model.simulator.structure import rows_of_line, spans
from model.types import Array


class PlasticSpring(AxialForce):
    r"""A rest length that flows, by a strain p.

    $f = -k\,L\,(1 - h)\,p$ with $\dot p = r\,\mathrm{sgn}(e)\max(0, |e| - \varepsilon_y)$,
    $e = |d|/L - 1 - p$: beside what yields a spring of $h k$ stays elastic and pulls it back. Of an e below
    zero a spring that goes slack bears, and feels, $1 - \beta$.

    Args:
        stiffness: k [N/m] of the linear spring, shape [spring_count].
        share: How strongly it acts on each spring [1], shape [spring_count].
        flow_rate: r [1/s]; the faster, the nearer to perfect plasticity.
        yield_strain: $\varepsilon_y$ [1].
        hardening: h [1]: the share of the stiffness that is left beyond the yield strain.
        slackness: $\beta$ [1], shape [spring_count].

    Reference:
        Perzyna (1966), Fundamental problems in viscoplasticity, Advances in applied mechanics 9 (overstress
        flow), for one axis; Prager (1956), A new method of analyzing stresses and strains in work-hardening
        plastic solids, Journal of applied mechanics 23 (linear kinematic hardening).
    """

    name = "plasticity"
    internal = central = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "stiffness": Constant("N/m", "springs", (1.0, 1e5)),
        "share": Constant("1", "springs", (0.0, 1.0)),
        "flow_rate": Constant("1/s", "scene", (0.0, 100.0)),
        "yield_strain": Constant("1", "scene", (0.01, 0.05)),
        "hardening": Constant("1", "scene", (0.0, 0.9)),
        "slackness": Constant("1", "springs", (0.0, 1.0)),
    }
    memory: ClassVar[Mapping[str, float]] = {"plastic_strain": 0.0}

    def __init__(
        self,
        stiffness: TensorLike,
        share: TensorLike,
        flow_rate: TensorLike,
        yield_strain: TensorLike,
        hardening: TensorLike,
        slackness: TensorLike,
    ) -> None:
        """See the class."""
        super().__init__(
            stiffness=stiffness,
            share=share,
            flow_rate=flow_rate,
            yield_strain=yield_strain,
            hardening=hardening,
            slackness=slackness,
        )

    @staticmethod
    def law(
        length: Scalar,
        rest_length: Scalar,
        stiffness: Scalar,
        share: Scalar,
        flow_rate: Scalar,
        yield_strain: Scalar,
        hardening: Scalar,
        slackness: Scalar,
        plastic_strain: Scalar,
        dt: Scalar,
    ) -> tuple[Scalar, Scalar]:
        """What the tension loses [N], and the plastic strain after `dt`."""
        strain = length / rest_length - 1.0
        elastic = borne(strain - plastic_strain, slackness)
        over = torch.relu(elastic - yield_strain) - torch.relu(-elastic - yield_strain)
        flowed = (1.0 - torch.exp(-flow_rate * dt)) * share * over
        lost = (1.0 - hardening) * (borne(strain, slackness) - elastic)
        return -stiffness * rest_length * lost, plastic_strain + flowed


class Plasticity(Effect):
    """Springs strained beyond a yield strain stay longer or shorter; a rope keeps its bends.

    A rope is bent by far more than it is strained, and what it resists that with may yield. It has a
    stiffness of its own, and pulls at nothing in the first frame. What is thick bends by its springs, and
    what a cloth resists bending with is too little to see.
    """

    name = "plasticity"
    source = f"{PlasticSpring.__doc__}{PlasticBending.__doc__}"
    acts = "body"
    quantities: ClassVar[Mapping[str, Quantity]] = {
        "flow_rate": Quantity("1/s", (0.02, 100.0), 3.0, log=True),
        "yield_strain": Quantity("1", (0.001, 0.5), 0.03, log=True),
        "hardening": Quantity("1", (0.0, 0.95), 0.2),
        "bending_stiffness": Quantity("N·m²", (1e-8, 1.0), 1e-3, log=True),
        "yield_curvature": Quantity("1/m", (0.1, 100.0), 3.0, log=True),
    }
    absent: ClassVar[Mapping[str, float]] = {"flow_rate": 0.0, "bending_stiffness": 0.0}
    before: ClassVar[Mapping[str, float]] = {
        "hardening": 0.0,
        "bending_stiffness": 0.0,
        "yield_curvature": 3.0,
    }
    grid: ClassVar[Grid] = {"flow_rate": (3.0, 30.0), "yield_strain": (0.005, 0.04), "hardening": (0.25,)}
    terms = (PlasticSpring, PlasticBending)
    confused_with: ClassVar[Mapping[str, str]] = {
        "viscoelasticity": "let go, and wait long enough for it to come back",
        "damage": "stretch to the same length again",
        "grip_slip": "grip it again",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act: what damage takes is told from the first length, and yield would never end."""
        if "damage" in world.simulator.forces:
            return "its springs are damaged, as told from their first length"
        return no_springs(world)

    def within(self, world: World) -> Effect:
        """What is no rope has no bends that yield."""
        return self if len(_rows(world)) else YieldingSprings()

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Let the rest lengths flow, and the rest turns of rows of points in a rope."""
        share = on_springs(world, where)
        own = {name: values[name] for name in ("flow_rate", "yield_strain", "hardening")}
        world = world.with_force(
            PlasticSpring(spring_stiffness(world), share, **own, slackness=slackness_of(world))
        )
        triples = _rows(world)
        if not len(triples):
            return world
        span = torch.from_numpy(spans(world.system.points.double().numpy(), triples))
        there = on_points(world, where)[torch.from_numpy(triples[:, 1])]
        stiffness, curvature = values["bending_stiffness"], values["yield_curvature"]
        return world.with_force(
            PlasticBending(
                torch.from_numpy(triples),
                bending_stiffness=stiffness * there.to(stiffness),
                span=span,
                yield_turn=curvature * 0.5 * span.to(curvature),
                flow_rate=values["flow_rate"],
            )
        )


class YieldingSprings(Plasticity):
    """The same of what is no rope."""

    quantities: ClassVar[Mapping[str, Quantity]] = {
        name: Plasticity.quantities[name] for name in ("flow_rate", "yield_strain", "hardening")
    }
    absent: ClassVar[Mapping[str, float]] = {"flow_rate": 0.0}
    before: ClassVar[Mapping[str, float]] = {"hardening": 0.0}


def _rows(world: World) -> Int[Array, "R 3"]:
    return rows_of_line(world.system.points.double().numpy(), world.system.springs.numpy())
