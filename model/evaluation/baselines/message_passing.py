"""A network over a graph of particles that says where they are one frame later."""

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn


class MessagePassing(nn.Module):
    """Encodes particles and their pairs, passes messages between them, and decodes a vector per particle.

    Args:
        node_size: Features of a particle.
        edge_size: Features of a directed pair.
        width: Of all layers.
        passes: Rounds of messages.
        seed: Of its random start.

    Reference:
        Li et al. (2019), Propagation networks for model-based control under partial observation, ICRA, as in
        the public code of Zhang et al. (2024), Dynamic 3D Gaussian tracking for graph-based neural dynamics
        modeling, CoRL, arXiv:2410.18912.
    """

    def __init__(self, node_size: int, edge_size: int, *, width: int, passes: int, seed: int) -> None:
        """See the class."""
        super().__init__()
        self._passes = passes
        self.encode_node = _layers(node_size, width, width)
        self.encode_edge = _layers(edge_size, width, width)
        # one layer over pair, receiver and sender, each by itself, so that ends are seen once, not per pair
        self.message_edge = nn.Linear(width, width)
        self.message_ends = nn.Linear(width, 2 * width, bias=False)
        self.update = nn.Linear(2 * width, width)
        self.decode = _layers(width, width, 3)
        random = torch.Generator().manual_seed(seed)
        for layer in self.modules():
            if isinstance(layer, nn.Linear):
                bound = layer.in_features**-0.5
                nn.init.uniform_(layer.weight, -bound, bound, generator=random)
                if layer.bias is not None:
                    nn.init.zeros_(layer.bias)
        last = self.decode[-1]
        assert isinstance(last, nn.Linear)
        nn.init.zeros_(last.weight)  # begins with what would be without forces

    def forward(
        self, nodes: Float[Tensor, "b n f"], edges: Float[Tensor, "b e g"], pairs: Int[Tensor, "e 2"]
    ) -> Float[Tensor, "b n 3"]:
        """A vector for each particle.

        Args:
            nodes: Features of particles.
            edges: Features of pairs.
            pairs: (sender, receiver) of each.
        """
        start = torch.relu(self.encode_node(nodes))
        ways = self.message_edge(torch.relu(self.encode_edge(edges)))
        sender, receiver = pairs.T
        state = start
        for _ in range(self._passes):
            there, here = self.message_ends(state).chunk(2, dim=-1)
            sent = torch.relu(ways + there[:, sender] + here[:, receiver])
            heard = torch.zeros_like(state).index_add(1, receiver, sent)
            state = torch.relu(self.update(torch.cat([start, heard], dim=-1)) + state)
        decoded: Tensor = self.decode(state)
        return decoded


def _layers(size: int, width: int, out: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(size, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, out)
    )
