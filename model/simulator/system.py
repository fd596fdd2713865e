"""The object that moves, and its state."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import torch
from jaxtyping import Float, Int
from torch import Tensor

from model.errors import InputError
from model.simulator.edges import Edges
from model.simulator.parameters import Constant, Parametric, TensorLike


@dataclass(frozen=True)
class State:
    """Where the points are and how they move."""

    positions: Float[Tensor, "*b N 3"]
    """[m]."""
    velocities: Float[Tensor, "*b N 3"]
    """[m/s]."""
    memory: Mapping[str, Tensor] = field(default_factory=dict)
    """What laws with memory remember, as `term.variable`, one value per edge that the term acts on."""


@dataclass(frozen=True)
class Anchors:
    """Where the controllers are and how they move, at one instant."""

    positions: Float[Tensor, "*b C 3"]
    """[m]."""
    velocities: Float[Tensor, "*b C 3"]
    """[m/s]."""


class System(Parametric):
    """Mass points, the springs between them and the springs that controllers hold them by.

    It says what is there; the force terms say what it does. Never changed after it is made.

    Args:
        points: Rest positions [m], shape [point_count, 3].
        mass: Mass [kg], shape [point_count].
        springs: Pairs of points, shape [spring_count, 2].
        rest_length: Rest length [m], shape [spring_count].
        controller_springs: Pairs (controller, point), shape [controller_spring_count, 2].
        controller_rest_length: Rest length [m], shape [controller_spring_count].
        controller_points: Where the controllers are at rest [m], shape [controller_count, 3]; None where only
            their motion will be known.

    Raises:
        InputError: shapes that do not fit, an index out of range, a mass of zero, a value that is not finite.
    """

    constants: ClassVar[Mapping[str, Constant]] = {
        "mass": Constant("kg", "points", (1e-5, 1e2)),
        "rest_length": Constant("m", "springs", (1e-4, 1.0)),
        "controller_rest_length": Constant("m", "controllers", (0.0, 1.0)),
    }
    points: Tensor
    springs: Tensor
    controller_points: Tensor | None

    def __init__(
        self,
        *,
        points: Float[Tensor, "N 3"],
        mass: TensorLike,
        springs: Int[Tensor, "E 2"],
        rest_length: TensorLike,
        controller_springs: Int[Tensor, "S 2"] | None = None,
        controller_rest_length: TensorLike | None = None,
        controller_points: Float[Tensor, "C 3"] | None = None,
    ) -> None:
        """See the class."""
        if controller_springs is None:
            controller_springs = torch.zeros((0, 2), dtype=torch.long, device=points.device)
        if controller_rest_length is None:
            controller_rest_length = torch.zeros(len(controller_springs), dtype=points.dtype)
        super().__init__(mass=mass, rest_length=rest_length, controller_rest_length=controller_rest_length)
        if not bool(torch.isfinite(points).all()):
            raise InputError("points of the system are not finite: give finite rest positions [m]")
        count = 0 if not len(controller_springs) else int(controller_springs[:, 0].max()) + 1
        if controller_points is not None:
            _inside(controller_springs[:, 0], len(controller_points), "controller_springs", "controllers")
            count = len(controller_points)
        _inside(springs, len(points), "springs", "points")
        _inside(controller_springs[:, 1], len(points), "controller_springs", "points")
        _inside(controller_springs[:, 0], count, "controller_springs", "controllers")
        if bool((springs[:, 0] == springs[:, 1]).any()):
            raise InputError("springs of the system joins a point with itself: remove such pairs")
        self.register_buffer("points", points.detach().clone(), persistent=False)
        self.register_buffer("springs", springs.long(), persistent=False)
        held = None if controller_points is None else controller_points.detach().to(points).clone()
        self.register_buffer("controller_points", held, persistent=False)
        self.edges = Edges(springs, controller_springs, len(points), count if len(controller_springs) else 0)
        self._check()

    @property
    def controller_count(self) -> int:
        """Controllers that hold a point."""
        return self.edges.node_count - self.edges.point_count

    def with_values(self, **values: TensorLike) -> "System":
        """The same points and springs with other constants, as `mass` [kg]; all else is shared.

        Raises:
            InputError: as the class does.
        """
        other = super().with_values(**values)
        other._check()
        return other

    def _check(self) -> None:
        if bool((self.value("mass") == 0).any()):
            raise InputError("mass of the system has a zero: every point needs a mass [kg] above zero")
        check_shapes(self, self, "the system")

    def size(self, over: str) -> int | None:
        """How many values a constant over `over` has; None: any one number will do."""
        edges = self.edges
        return {
            "points": edges.point_count,
            "springs": edges.spring_count,
            "controllers": edges.controller_spring_count,
            "edges": len(edges),
            "vector": 3,
        }.get(over)

    def rest_state(self) -> State:
        """At rest positions and at rest."""
        return State(self.points, torch.zeros_like(self.points))


def check_shapes(module: Parametric, system: System, name: str) -> None:
    """Refuse constants that have neither one value nor one for each of what they act on.

    Raises:
        InputError: naming the constant, what was expected and what was found.
    """
    for key, constant in module.constants.items():
        shape, size = tuple(module.value(key).shape), module.own_size(constant.over)
        if constant.over == "scene":
            # scenes that are joined have one value for each of their edges or stencils
            size = module.own_size("stencils")
            size = system.size(getattr(module, "where", "")) if size is None else size
        elif size is None:
            size = system.size(constant.over)
        if constant.over == "vector":
            fits = shape[-1:] == (3,)
        else:
            fits = shape[-1:] in ((), (1,), (size,))
        if not fits:
            wanted = "3 numbers" if constant.over == "vector" else f"one value or {size or 1} of them"
            raise InputError(f"{key} of {name} has shape {list(shape)}: give {wanted}")


def _inside(indices: Tensor, count: int, name: str, what: str) -> None:
    if indices.numel() and not (0 <= int(indices.min()) and int(indices.max()) < count):
        raise InputError(
            f"{name} of the system points outside its {count} {what}: indices are 0 … {count - 1}"
        )
