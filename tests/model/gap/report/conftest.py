"""A cloth that hangs from two corners, once in the wind, and what a diagnosis could say of it."""

import itertools
import json
from dataclasses import dataclass, replace

import numpy as np
import pytest

from model.gap.report.findings import Findings
from model.gap.schema import EFFECT_NAMES, SCHEMA, GapReport
from model.schema import read_json

ROWS, COLUMNS, SPACING, FRAMES, FPS = 10, 12, 0.03, 90, 30.0
SUBSTEPS, MASS, DASHPOT = 14, 1e-3, 0.01
WIND = np.array([1.1, 1.9, 0.0])
SEED = 3


@pytest.fixture(scope="session")
def cloth():
    """What moved, and the twins' rollouts of it."""
    times = np.arange(FRAMES) / FPS
    rest, hands = _rest(), _hands(times)
    real = _swing(hands, stiffness=14.0, wind=WIND)
    rng = np.random.default_rng(SEED)
    observed = real + rng.normal(0.0, 1.2e-3, real.shape)
    observed[rng.random(observed.shape[:2]) < 0.07] = np.nan
    return Cloth(
        times,
        rest,
        hands,
        observed,
        came=_swing(hands, stiffness=5.0, wind=0 * WIND),
        before=_swing(hands, stiffness=13.0, wind=0 * WIND),
        after=_swing(hands, stiffness=13.7, wind=0.97 * WIND),
    )


@pytest.fixture
def findings(cloth):
    """A clear case: wind."""
    return _findings(cloth, clear_report(cloth))


@pytest.fixture
def report(findings):
    return findings.report


@pytest.fixture
def alike(findings):
    """The same, where a tilt of gravity looks like the wind, confirmed on a second interaction."""
    content = as_json(findings.report)
    content["verdict"] |= {"probability": 0.58, "statement": ""}
    chances = {"wind": 0.58, "gravity_tilt": 0.37, "quadratic_air_drag": 0.02}
    for effect in content["effects"]:
        effect["probability"] = chances.get(effect["name"], 0.001)
    content["effects"].sort(key=lambda effect: -effect["probability"])
    content["effects"][0]["confused_with"] = ["gravity_tilt"]
    content["effects"][1] |= {
        "confused_with": ["wind"],
        "parameters": {"about_x": {"value": 0.08, "unit": "rad", "ci95": [0.05, 0.11]}},
    }
    content["gap"]["transfer"] = content["gap"] | {"heldout": [[0.0, 2.4]]}
    content["warnings"] = ["wind and gravity_tilt look alike here (cosine 0.94)"]
    return replace(findings, report=parse(content))


@pytest.fixture
def late(alike):
    """The same, in seconds since 1970."""
    begin, content = 1.7e9, as_json(alike.report)
    content["gap"]["heldout"] = [[begin + time for time in span] for span in content["gap"]["heldout"]]
    for phase in content["where"]["phases"]:
        phase |= {key: begin + phase[key] for key in ("start_s", "end_s")}
    return replace(alike, report=parse(content), times=begin + alike.times)


@pytest.fixture
def pair(alike):
    """Two effects with the longest names."""
    content = as_json(alike.report)
    names = {"wind": "mass_heterogeneity", "gravity_tilt": "volume_preservation"}
    names |= {other: name for name, other in names.items()}
    for effect in content["effects"]:
        effect |= {"name": names.get(effect["name"], effect["name"]), "confused_with": []}
    content["verdict"] |= {"effect": "mass_heterogeneity", "second": "volume_preservation"}
    return replace(alike, report=parse(content))


@pytest.fixture
def nothing(findings, cloth):
    """A healthy twin."""
    noise = np.random.default_rng(SEED + 1).normal(0.0, 1e-3, cloth.before.shape)
    healthy = replace(cloth, observed=(cloth.before + noise))
    return _ended(_findings(healthy, clear_report(healthy)), "none", 0.97)


@pytest.fixture
def unknown(findings):
    """Something that the catalogue does not have."""
    return _ended(findings, "unknown", 0.88)


@dataclass(frozen=True)
class Cloth:
    times: np.ndarray
    rest: np.ndarray
    hands: np.ndarray
    observed: np.ndarray
    came: np.ndarray
    before: np.ndarray
    after: np.ndarray


def parse(content):
    return read_json(json.dumps(content).encode(), GapReport, "report.json")


def as_json(report):
    return json.loads(report.model_dump_json(by_alias=True))


def clear_report(cloth):
    """Wind, with the figures that the rollouts have."""
    gap = np.linalg.norm(cloth.before - cloth.observed, axis=-1)
    points, frames = np.nanmean(gap, 0), np.nanmean(gap, 1)
    held = cloth.times >= 2.1
    errors = {name: _mean(cloth, getattr(cloth, name), held) for name in ("came", "before", "after")}
    floor = 1.9e-3
    closed = (errors["before"] - errors["after"]) / (errors["before"] - floor)
    spans = {"lift": (0.0, 0.8), "swing": (0.8, 2.0), "hold": (2.0, float(cloth.times[-1]))}
    inside = {
        name: (cloth.times >= a) & (cloth.times < b + (name == "hold")) for name, (a, b) in spans.items()
    }
    share = frames / frames.sum()
    lower = np.arange(len(points)) // COLUMNS < ROWS // 2
    rest = (1.0 - 0.93) / (len(EFFECT_NAMES) + 1)
    return parse(
        {
            "schema": SCHEMA,
            "verdict": {"effect": "wind", "probability": 0.93, "statement": ""},
            "gap": {
                "metric": "track_error_m",
                "baseline": errors["came"],
                "refit": errors["before"],
                "with_effect": errors["after"],
                "noise_floor": floor,
                "ceiling": 0.5 * (floor + errors["after"]),
                "closed_fraction": closed,
                "closed_fraction_ci95": [closed - 0.04, closed + 0.03],
                "heldout": [[2.1, float(cloth.times[-1])]],
            },
            "effects": [_effect(name, 0.93 if name == "wind" else rest, errors) for name in _ranking()],
            "where": {
                "points": list(points / points.sum()),
                "frames": list(share),
                "parts": [
                    {"part": "lower half", "share": float(points[lower].sum() / points.sum())},
                    {"part": "upper half", "share": float(points[~lower].sum() / points.sum())},
                ],
                "phases": [
                    {"name": name, "start_s": a, "end_s": b, "share": float(share[inside[name]].sum())}
                    for name, (a, b) in spans.items()
                ],
                "acts_on": [1.0] * len(points),
            },
            "sources": {
                "perception": 0.04,
                "actuation": 0.02,
                "parameters": 0.31,
                "physics": 0.58,
                "unexplained": 0.05,
            },
            "warnings": [],
        }
    )


def _ranking():
    return ["wind", *(name for name in EFFECT_NAMES if name != "wind")]


def _effect(name, probability, errors):
    fitted = {}
    if name == "wind":
        fitted = {
            "drag_per_mass": {"value": 0.52, "unit": "1/m", "ci95": [0.41, 0.63]},
            "x": {"value": 1.07, "unit": "m/s", "ci95": [0.9, 1.2]},
            "y": {"value": 1.84, "unit": "m/s", "ci95": [1.7, 2.0]},
        }
    error = errors["after"] if name == "wind" else 0.97 * errors["before"]
    return {
        "name": name,
        "probability": probability,
        "heldout_error_m": error,
        "evidence": 41.3 if name == "wind" else 1.2,
        "parameters": fitted,
        "confused_with": [],
    }


def _ended(findings, verdict, probability):
    """The same arrays under a verdict without an effect."""
    content = as_json(findings.report)
    content["verdict"] = {"effect": verdict, "probability": probability, "statement": ""}
    content["gap"] |= {"with_effect": None, "closed_fraction": None, "closed_fraction_ci95": None}
    content["gap"]["ceiling"] = min(content["gap"]["ceiling"], 0.95 * content["gap"]["refit"])
    content["where"]["acts_on"] = [0.0] * len(content["where"]["points"])
    for effect in content["effects"]:
        effect["probability"] = 0.1 * (1 - probability) / len(EFFECT_NAMES)
    return replace(findings, report=parse(content), after=None, error_after=None)


def _findings(cloth, report):
    errors = {
        name: np.nanmean(np.linalg.norm(getattr(cloth, name) - cloth.observed, axis=-1), 1)
        for name in ("came", "before", "after")
    }
    gap = report.gap
    return Findings(
        report=report,
        times=cloth.times,
        observed=cloth.observed,
        before=cloth.before,
        error_baseline=errors["came"],
        error_refit=errors["before"],
        rest=cloth.rest,
        controllers=cloth.hands,
        after=cloth.after,
        error_after=errors["after"],
        intervals={
            "baseline": (0.9 * gap.baseline, 1.1 * gap.baseline),
            "refit": (0.92 * gap.refit, 1.08 * gap.refit),
            "with_effect": (0.8 * gap.with_effect, 1.2 * gap.with_effect),
        },
    )


def _mean(cloth, rollout, held):
    return float(np.nanmean(np.linalg.norm(rollout - cloth.observed, axis=-1)[held]))


def _rest():
    row, column = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    return np.stack([SPACING * column, 0.0 * row, 0.3 + SPACING * row], -1)


def _hands(times):
    corners = _rest()[[-COLUMNS, -1]]
    way = np.stack([0 * times, 0.12 * np.sin(3.2 * times), 0.05 * (1 - np.cos(3.2 * times))], -1)
    way[times > 2.0] = way[times <= 2.0][-1]
    return corners[None] + way[:, None]


def _swing(hands, stiffness, wind):
    """Semi-implicit Euler over springs to the neighbours, with drag towards the air."""
    points = _rest()
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    i, j = np.nonzero(np.triu(apart < 1.5 * SPACING, 1))
    length, held = apart[i, j], [len(points) - COLUMNS, len(points) - 1]
    incidence = np.zeros((len(points), len(i)))
    incidence[i, np.arange(len(i))], incidence[j, np.arange(len(j))] = 1.0, -1.0
    x, v, dt = points.copy(), np.zeros_like(points), 1.0 / FPS / SUBSTEPS
    out = [x.copy()]
    for start, end in itertools.pairwise(hands):
        for step in range(SUBSTEPS):
            d = x[j] - x[i]
            size = np.linalg.norm(d, axis=-1)
            along = ((v[j] - v[i]) * d).sum(-1) / size
            pull = (stiffness * (size - length) + DASHPOT * along) / size
            seen = wind - v
            air = 0.5 * np.linalg.norm(seen, axis=-1, keepdims=True) * seen
            v += dt * (incidence @ (pull[:, None] * d) / MASS + air - [0.0, 0.0, 9.81])
            v[held] = (end - start) * FPS
            x += dt * v
            x[held] = start + (end - start) * (step + 1) / SUBSTEPS
        out.append(x.copy())
    return np.array(out)
