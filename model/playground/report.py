"""Where a gap report sees the gap, on the points of a twin."""

from pathlib import Path

import numpy as np
from jaxtyping import Int64
from scipy.spatial import cKDTree

from model.bundle import TwinBundle
from model.errors import InputError
from model.gap.bodies.first import first_places
from model.gap.graph import Graph
from model.gap.registration import onto_twin
from model.gap.schema import GapReport
from model.observation import read_observation
from model.playground.colors import Where
from model.schema import read_json
from model.types import Array

NEAREST = 4
"""Observed points that a mass point takes its value from."""


def read_where(report: Path, bundle: TwinBundle, observation: Path | None = None) -> Where:
    """Read `report.json` for the points of a twin.

    A report has values for the points of an observation. Where the twin has as many points, they are the
    same; else the observation says where they were, and each point of the twin takes the nearest ones' mean.

    Args:
        report: The file, or the folder of a diagnosis that it is in.
        bundle: The twin.
        observation: What the report is about.

    Raises:
        InputError: no report, or one of other points while no observation is given.
    """
    path = report / "report.json" if report.is_dir() else report
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    where = read_json(data, GapReport, path.name).where
    gap, effect = (np.array(values, np.float64) for values in (where.points, where.acts_on))
    count = len(bundle.topology.points)
    if observation is not None:
        near = _nearest(observation, bundle, len(gap), path.name)
        gap, effect = gap[near].mean(axis=1), effect[near].mean(axis=1)
    elif len(gap) != count:
        raise InputError(
            f"{path.name}: where: {len(gap)} observed points, the twin has {count}: "
            "give the observation that the report is about (--observation)"
        )
    return Where(gap / max(float(gap.max()), 1e-12), effect)


def _nearest(observation: Path, bundle: TwinBundle, count: int, report: str) -> Int64[Array, "N k"]:
    """The observed points nearest to each point of the twin."""
    graph = Graph.of(bundle)
    # where the diagnosis has looked at it
    places = first_places(onto_twin(read_observation(observation), graph.points, graph.spacing))
    if len(places) != count:
        raise InputError(
            f"{observation.name}: {len(places)} points, {report} has {count}: give the one it is about"
        )
    seen = np.flatnonzero(np.isfinite(places[:, 0]))
    _, near = cKDTree(places[seen]).query(bundle.topology.points, k=min(NEAREST, len(seen)))
    nearest: Int64[Array, "N k"] = seen[near.reshape(len(bundle.topology.points), -1)]
    return nearest
