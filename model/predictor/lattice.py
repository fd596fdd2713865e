"""Stiffness of springs such that their network has a given Young's modulus."""

import numpy as np
from jaxtyping import Float, Float64, Integer
from scipy.spatial import cKDTree

from model.types import Array, ShapeClass, Topology

SHEET = 3.0
"""Area density of Σ k L² over the modulus of an isotropic plane network."""
SKIN = 0.08
"""Least share of a rope's springs: the surface keeps its shape."""
_SURROUNDINGS = 40
"""Points that say which way the body runs."""


def lattice_stiffness(
    topology: Topology,
    modulus: Float[Array, " K"],
    volume: Float[Array, " K"],
    shape_class: ShapeClass,
) -> Float64[Array, " E"]:
    r"""Springs k = Y/L with each part's Y such that stretching the part shows its modulus [N/m].

    A network of central springs that deforms affinely has the energy density
    $\frac{1}{2V}\sum k L^2 (n\cdot\varepsilon n)^2$, so its elasticity tensor is
    $C=\frac1V\sum kL^2\,n\otimes n\otimes n\otimes n$. Without preferred direction that is
    $\lambda=\mu=\frac{1}{15V}\sum kL^2$ in space and $\frac{1}{8A}\sum kL^2$ in a plane, hence

    $E = \frac{1}{6V}\sum kL^2$ (solid) and $E h = \frac{1}{3A}\sum kL^2$ (sheet of thickness h).

    In a limb or a rope a few points thick, more springs run along than across (each point misses the
    neighbours beyond the surface), which makes it stiffer along by up to a fifth. So for solids and ropes
    C is summed with θ, the angle to the direction in which the body runs locally, and symmetric about it:

    $E = C_{11} - 2C_{12}^2/(C_{22}+C_{23})$ with $C_{11}=\langle\cos^4\theta\rangle$,
    $C_{12}=\frac12\langle\cos^2\theta\sin^2\theta\rangle$, $C_{22}+C_{23}=\frac12\langle\sin^4\theta\rangle$

    (each times $\sum kL^2/V$): 1/6 for directions without preference, 1 for springs all along the axis.
    Springs across a border take the mean of the logarithms of their two parts' moduli: the mean modulus
    would be at least half the stiffer one's, however soft the other part is.

    In a rope Y falls off from the axis to the surface (`_core`): its yarns slide on each other, so it bends
    far more easily than a rod of the same stiffness in tension.

    Args:
        topology: Springs and their rest lengths.
        modulus: Young's modulus per part [Pa].
        volume: Per part [m³].
        shape_class: Sheet, rope or solid.

    Reference:
        Hrennikoff (1941), Solution of problems of elasticity by the framework method; Kot, Nagahashi and
        Szymczak (2015), Elastic moduli of simple mass spring models (E from Σ k L², Poisson's ratio 1/4);
        Jiang et al. (2025), PhysTwin (k = Y/L).
    """
    shares = lattice_shares(topology, len(modulus), shape_class)
    return sprung(shares, np.log(np.asarray(modulus, np.float64)), volume, topology.part[topology.springs])


def sprung(
    shares: Float64[Array, "E 2"],
    log_modulus: Float64[Array, " K"],
    volume: Float[Array, " K"],
    ends: Integer[Array, "E 2"],
) -> Float64[Array, " E"]:
    """What `lattice_stiffness` is of known shares [N/m].

    Args:
        shares: From `lattice_shares`.
        log_modulus: ln of Young's modulus per part [ln Pa].
        volume: Per part [m³].
        ends: Parts that each spring joins.
    """
    unit = (shares * volume[ends]).sum(axis=1)
    stiffness: Float64[Array, " E"] = unit * np.exp(between(log_modulus, ends))
    return stiffness


def between(log_modulus: Float64[Array, " K"], ends: Integer[Array, "E 2"]) -> Float64[Array, " E"]:
    """Ln of the modulus that each spring means, of those of its two ends' parts [ln Pa]."""
    mean: Float64[Array, " E"] = log_modulus[ends].mean(axis=1)
    return mean


def lattice_shares(topology: Topology, parts: int, shape_class: ShapeClass) -> Float64[Array, "E 2"]:
    """What each end's part adds to a spring's stiffness in a body of 1 Pa, per volume of that part [1/m²].

    It depends on the network alone, so it is found once for many beliefs about the materials; see
    `sprung`, which sums it up.
    """
    length = topology.rest_length.astype(np.float64)
    ends = topology.part[topology.springs]

    def per_part(values: Float64[Array, "E 2"]) -> Float64[Array, " K"]:
        # half of every spring belongs to each of its ends, so half of a border spring to each part
        total: Float64[Array, " K"] = np.bincount(ends.ravel(), 0.5 * values.ravel(), minlength=parts)
        return total

    share = np.ones(len(length)) if shape_class != "rope" else _core(topology)
    both = np.repeat((share * length)[:, None], 2, axis=1)
    if shape_class == "sheet":
        resistance = per_part(both) / SHEET
    else:
        along = _squared_cosines(topology)
        axial, mixed = per_part(both * along**2), 0.5 * per_part(both * along * (1.0 - along))
        across = 0.5 * per_part(both * (1.0 - along) ** 2)
        resistance = axial - 2.0 * mixed**2 / np.maximum(across, 1e-12 * length.sum())
    ease = 1.0 / np.where(resistance > 0, resistance, np.inf)
    shares: Float64[Array, "E 2"] = 0.5 * ease[ends] * (share / length)[:, None]
    return shares


def _core(topology: Topology) -> Float64[Array, " E"]:
    """Share of the load that a rope's springs take: (1 - r/R)² of the way from the axis, at least `SKIN`."""
    around, points = _surroundings(topology)
    middle, axes = around.mean(axis=1), _axes(around)
    offset = points - middle
    away = np.linalg.norm(offset - np.einsum("ni,ni->n", offset, axes)[:, None] * axes, axis=1)
    outer = np.quantile(away, 0.9)
    share = (
        (1.0 - np.minimum(away / max(float(outer), 1e-12), 1.0)) ** 2 if outer > 1e-9 else np.ones(len(away))
    )
    return np.asarray(np.maximum(share, SKIN)[topology.springs].mean(axis=1), np.float64)


def _squared_cosines(topology: Topology) -> Float64[Array, "E 2"]:
    """Of the angle between each spring and the direction in which the body runs around either end."""
    around, points = _surroundings(topology)
    axes = _axes(around)
    first, second = topology.springs.T
    direction = (points[second] - points[first]) / topology.rest_length.astype(np.float64)[:, None]
    squares = [np.einsum("ei,ei->e", direction, axes[end]) ** 2 for end in (first, second)]
    return np.stack(squares, axis=1)


def _surroundings(topology: Topology) -> tuple[Float64[Array, "N k 3"], Float64[Array, "N 3"]]:
    points = topology.points.astype(np.float64)
    count = min(_SURROUNDINGS, len(points))
    around = points[cKDTree(points).query(points, count)[1].reshape(len(points), count)]
    return np.asarray(around, np.float64), points


def _axes(around: Float64[Array, "N k 3"]) -> Float64[Array, "N 3"]:
    """Direction of the largest extent of each surroundings."""
    offset = around - around.mean(axis=1, keepdims=True)
    axes: Float64[Array, "N 3"] = np.linalg.eigh(np.einsum("nki,nkj->nij", offset, offset))[1][:, :, -1]
    return axes
