"""What can be chosen about the network."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

from model.errors import InputError
from model.predictor.checks import at_least
from model.predictor.network import PredictorNetwork


@dataclass(frozen=True)
class NetworkOptions:
    """What can be chosen about a `PredictorNetwork`, as a configuration file and a checkpoint name it.

    Attributes:
        dim: Length of a token.
        layers: Of the transformer.
        heads: Of attention.
        dropout: Share of activations left out in training.
        codebook: False leaves out the embeddings of materials.
        parts: False makes every object one part.
        motion: False hides what moved.
        geometry: False hides where springs are.
    """

    dim: int = 64
    layers: int = 2
    heads: int = 4
    dropout: float = 0.1
    codebook: bool = True
    parts: bool = True
    motion: bool = True
    geometry: bool = True

    def __post_init__(self) -> None:
        """Refuse what no network can be.

        Raises:
            InputError: see the message.
        """
        at_least(1, "model.network", dim=self.dim, layers=self.layers, heads=self.heads)
        if self.dim % self.heads:
            raise InputError(f"model.network.heads is {self.heads}: expected a divisor of dim, {self.dim}")
        if not 0.0 <= self.dropout < 1.0:
            raise InputError(f"model.network.dropout is {self.dropout}: expected 0 or more, below 1")

    def build(self, motion_dim: int, motion_global_dim: int) -> PredictorNetwork:
        """An untrained network for these widths of motion features (per point, per clip)."""
        return PredictorNetwork(
            motion_dim=motion_dim,
            motion_global_dim=motion_global_dim,
            dim=self.dim,
            layers=self.layers,
            heads=self.heads,
            dropout=self.dropout,
            codebook=self.codebook,
            parts=self.parts,
            motion=self.motion,
            geometry=self.geometry,
        )

    def as_dict(self) -> dict[str, int | float | bool]:
        """By name."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, object]) -> "NetworkOptions":
        """What `as_dict` made.

        Raises:
            InputError: a name that there is not, or a value of another type.
        """
        known = {field.name: type(field.default) for field in fields(cls)}
        for name, value in values.items():
            if name not in known or type(value) not in (known[name], int):
                raise InputError(f"options of the network: {name} = {value!r} is not among them")
        return cls(**values)  # type: ignore[arg-type]
