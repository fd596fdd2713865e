"""Differences along edges and sums over them: the incidence of the spring graph, both ways differentiable."""

import warnings
from typing import Any, TypeAlias

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn


class Edges(nn.Module):
    """Springs between points, followed by springs from points to controllers.

    Edge e goes from node `first[e]`, always a point, to node `second[e]`: nodes are the N points followed by
    the C controllers. Sums run over rows of a sparse matrix, so they are deterministic and need no atomics.
    """

    first: Tensor
    second: Tensor
    _rows: Tensor
    _columns: Tensor
    _signs: Tensor

    def __init__(
        self,
        springs: Int[Tensor, "E 2"],
        controller_springs: Int[Tensor, "S 2"],
        point_count: int,
        controller_count: int,
    ) -> None:
        """Index the graph.

        Args:
            springs: Pairs of points.
            controller_springs: Pairs (controller, point).
            point_count: N.
            controller_count: C.
        """
        super().__init__()
        self.spring_count, self.controller_spring_count = len(springs), len(controller_springs)
        self.point_count, self.node_count = point_count, point_count + controller_count
        first = torch.cat([springs[:, 0], controller_springs[:, 1]]).long()
        second = torch.cat([springs[:, 1], controller_springs[:, 0] + point_count]).long()
        self.register_buffer("first", first, persistent=False)
        self.register_buffer("second", second, persistent=False)
        ends = torch.cat([first, second])
        counts = torch.bincount(ends, minlength=self.node_count)
        rows = torch.cat([counts.new_zeros(1), counts.cumsum(0)])
        edge = torch.arange(len(first), device=first.device).repeat(2)
        order = torch.argsort(ends * len(first) + edge)
        sign = torch.ones(len(first), device=first.device)
        # MKL takes 32-bit indices; anything wider would be converted again in every substep
        self.register_buffer("_rows", rows.int(), persistent=False)
        self.register_buffer("_columns", edge[order].int(), persistent=False)
        self.register_buffer("_signs", torch.cat([-sign, sign])[order], persistent=False)
        self._matrices: dict[tuple[torch.dtype, torch.device], Tensor] = {}

    def __len__(self) -> int:
        """Springs and controller springs together."""
        return self.spring_count + self.controller_spring_count

    def difference(self, nodes: Float[Tensor, "*b n 3"]) -> Float[Tensor, "*b e 3"]:
        """`nodes[second] - nodes[first]` for each edge."""
        if torch.is_grad_enabled() and nodes.requires_grad:
            result: Tensor = _Difference.apply(nodes, self)  # type: ignore[no-untyped-call]
            return result
        return _difference(nodes, self)

    def total(self, flows: Float[Tensor, "*b e 3"]) -> Float[Tensor, "*b n 3"]:
        """For each node the sum of what flows in at `second` minus what flows out at `first`."""
        if torch.is_grad_enabled() and flows.requires_grad:
            result: Tensor = _Total.apply(flows, self)  # type: ignore[no-untyped-call]
            return result
        return _total(flows, self)

    def matrix(self, like: Tensor) -> Tensor:
        """The incidence matrix [n, e]: -1 where an edge begins, +1 where it ends."""
        key = (like.dtype, like.device)
        if key not in self._matrices:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # torch calls every CSR tensor a beta feature
                self._matrices[key] = torch.sparse_csr_tensor(
                    self._rows.to(like.device),
                    self._columns.to(like.device),
                    self._signs.to(like),
                    size=(self.node_count, len(self)),
                    check_invariants=True,
                )
        return self._matrices[key]


def _difference(nodes: Tensor, edges: Edges) -> Tensor:
    return nodes.index_select(-2, edges.second) - nodes.index_select(-2, edges.first)


def _total(flows: Tensor, edges: Edges) -> Tensor:
    if flows.ndim == 2:
        return edges.matrix(flows) @ flows
    batch = flows.shape[:-2]
    columns = flows.reshape(-1, len(edges), 3).transpose(0, 1).reshape(len(edges), -1)
    sums = (edges.matrix(flows) @ columns).reshape(edges.node_count, -1, 3).transpose(0, 1)
    return sums.reshape(*batch, edges.node_count, 3)


_Context: TypeAlias = Any
"""What torch hands a function's two halves to share."""


class _Difference(torch.autograd.Function):
    """Linear, so its adjoint is the transposed matrix: the total."""

    @staticmethod
    def forward(ctx: _Context, nodes: Tensor, edges: Edges) -> Tensor:
        ctx.edges = edges
        return _difference(nodes, edges)

    @staticmethod
    def backward(ctx: _Context, gradient: Tensor) -> tuple[Tensor, None]:
        return ctx.edges.total(gradient), None


class _Total(torch.autograd.Function):
    """Linear, so its adjoint is the transposed matrix: the difference."""

    @staticmethod
    def forward(ctx: _Context, flows: Tensor, edges: Edges) -> Tensor:
        ctx.edges = edges
        return _total(flows, edges)

    @staticmethod
    def backward(ctx: _Context, gradient: Tensor) -> tuple[Tensor, None]:
        return ctx.edges.difference(gradient), None
