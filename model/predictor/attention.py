"""Attention over sets of different sizes: points of a part, parts of an object."""

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor, nn
from torch.nn.functional import scaled_dot_product_attention


class AttentionPool(nn.Module):
    """Each group's rows, weighed by how well they answer the group's query.

    Args:
        dim: Of rows, queries and the answer; a multiple of `heads`.
        heads: Sets of weights.

    Reference:
        Lee et al. (2019), Set Transformer, section 3.2 (pooling by attention).
    """

    def __init__(self, dim: int, heads: int) -> None:
        """Draw the weights."""
        super().__init__()
        self.heads = heads
        self.key = nn.Linear(dim, dim)
        self.value = nn.Linear(dim, dim)

    def forward(
        self, rows: Float[Tensor, "n d"], query: Float[Tensor, "K d"], group: Int64[Tensor, " n"]
    ) -> Float[Tensor, "K d"]:
        """Pool; a group without rows gets zeros.

        Args:
            rows: What to pool.
            query: One per group.
            group: Of each row.
        """
        count, size = len(query), rows.shape[1] // self.heads
        keys, values = (layer(rows).reshape(-1, self.heads, size) for layer in (self.key, self.value))
        asked = query.reshape(-1, self.heads, size)[group]
        score = (keys * asked).sum(-1) / size**0.5
        most = score.detach().new_full((count, self.heads), -torch.inf)
        most = most.scatter_reduce(0, group[:, None].expand_as(score), score.detach(), "amax")
        weight = (score - most[group]).exp()
        total = weight.new_zeros(count, self.heads).index_add(0, group, weight)
        answer = values.new_zeros(count, self.heads, size).index_add(0, group, weight[..., None] * values)
        pooled: Tensor = answer / total.clamp_min(1e-12)[..., None]
        return pooled.reshape(count, -1)


class Mixer(nn.Module):
    """A transformer over the token of a case and those of its parts, whose order does not matter.

    Args:
        dim: Length of a token.
        layers: How many blocks.
        heads: Of each.
        dropout: Share of activations left out in training.

    Reference:
        Xiong et al. (2020), On layer normalization in the transformer architecture (normalised first).
    """

    def __init__(self, dim: int, layers: int, heads: int, dropout: float) -> None:
        """Draw the weights."""
        super().__init__()
        self.blocks = nn.ModuleList(_Block(dim, heads, dropout) for _ in range(layers))
        self.last = nn.LayerNorm(dim)

    def forward(
        self, scene: Float[Tensor, "B d"], part: Float[Tensor, "K d"], part_scene: Int64[Tensor, " K"]
    ) -> tuple[Float[Tensor, "B d"], Float[Tensor, "K d"]]:
        """Let the tokens of each case look at each other.

        Args:
            scene: One token per case.
            part: One per part, those of a case together, in the order of the cases.
            part_scene: The case of each part.
        """
        counts = torch.bincount(part_scene, minlength=len(scene))
        first = counts.cumsum(0) - counts
        place = 1 + torch.arange(len(part), device=part.device) - first[part_scene]
        width = 1 + int(counts.max())
        tokens = part.new_zeros(len(scene), width, part.shape[1])
        tokens = tokens.index_put((part_scene, place), part)
        tokens = torch.cat([scene[:, None], tokens[:, 1:]], dim=1)
        there = torch.arange(width, device=part.device)[None] <= counts[:, None]
        for block in self.blocks:
            tokens = block(tokens, there)
        tokens = self.last(tokens)
        return tokens[:, 0], tokens[part_scene, place]


class _Block(nn.Module):
    def __init__(self, dim: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads = heads
        self.before, self.between = nn.LayerNorm(dim), nn.LayerNorm(dim)
        self.ask, self.answer = nn.Linear(dim, 3 * dim), nn.Linear(dim, dim)
        self.think = nn.Sequential(
            nn.Linear(dim, 2 * dim), nn.GELU(), nn.Dropout(dropout), nn.Linear(2 * dim, dim)
        )

    def forward(self, tokens: Float[Tensor, "B n d"], there: Bool[Tensor, "B n"]) -> Float[Tensor, "B n d"]:
        batch, count, dim = tokens.shape
        asked = self.ask(self.before(tokens)).reshape(batch, count, 3, self.heads, -1)
        query, key, value = asked.permute(2, 0, 3, 1, 4)
        heard = scaled_dot_product_attention(query, key, value, attn_mask=there[:, None, None, :])
        tokens = tokens + self.answer(heard.transpose(1, 2).reshape(batch, count, dim))
        thought: Tensor = self.think(self.between(tokens))
        return tokens + thought
