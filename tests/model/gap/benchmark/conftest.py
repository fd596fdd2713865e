"""A folder of worlds without physics: what is tested is the counting."""

import json

import numpy as np
import pytest

from model.gap.benchmark.predict import Prediction
from model.gap.diagnosis import Diagnosis
from model.gap.report.findings import Findings
from model.gap.schema import EFFECT_NAMES, SCHEMA, GapReport

POINTS, FRAMES = 6, 30
ACTS = (1.0, 0.9, 0.6, 0.1, 0.0, 0.0)


def report_of(answer, probability=0.8, second=None, parameters=None, acts_on=None, transfer=None):
    """A gap report with this verdict; the other effects share what is left, in alphabetical order."""
    named = [name for name in (answer, second) if name in EFFECT_NAMES]
    others = sorted(set(EFFECT_NAMES) - set(named))
    ranked = [(name, probability) for name in named]
    ranked += [(name, 0.45 * (1 - probability) * 0.5**k) for k, name in enumerate(others)]
    closure = {
        "baseline": 0.02,
        "refit": 0.01,
        "with_effect": 0.004 if named else None,
        "noise_floor": 0.002,
        "closed_fraction": 0.75 if named else None,
        "heldout": [[0.1, 0.2]],
    }
    gap = closure | ({"transfer": closure | transfer} if transfer is not None else {})
    return GapReport.model_validate(
        {
            "schema": SCHEMA,
            "verdict": {"effect": answer, "probability": probability, "statement": "."}
            | ({"second": second} if second else {}),
            "gap": gap,
            "effects": [
                {"name": name, "probability": chance}
                | ({"parameters": parameters or {}} if name == answer else {})
                for name, chance in ranked
            ],
            "where": {
                "points": [1 / POINTS] * POINTS,
                "frames": [1 / FRAMES] * FRAMES,
                "acts_on": list(acts_on or (ACTS if named else [0.0] * POINTS)),
            },
            "sources": dict.fromkeys(("perception", "actuation", "parameters", "physics"), 0.25)
            | {"unexplained": 0.0},
        }
    )


def said(answer, **options):
    return Prediction(report_of(answer, **options))


def label_of(world, *names, magnitude=4.0, accepted=None, category=None, acts_on=ACTS, amplitude=0.1):
    label = {
        "world": world,
        "category": category or ("null" if not names else "single" if len(names) == 1 else "pair"),
        "kind": "rope",
        "effects": [{"name": name, "amplitude": amplitude, "options": {"sign": -1.0}} for name in names],
        "accepted": accepted or list(names) or ["none"],
        "acts_on": {name: list(acts_on) for name in names},
    }
    return label | ({"magnitude": magnitude} if names else {})


def diagnosis_of(report):
    still = np.zeros((FRAMES, POINTS, 3))
    errors = np.zeros(FRAMES)
    named = report.named is not None
    return Diagnosis(
        Findings(
            report=report,
            times=np.arange(FRAMES) / 30,
            observed=still,
            before=still,
            error_baseline=errors,
            error_refit=errors,
            rest=still[0],
            controllers=still[:, :1],
            after=still if named else None,
            error_after=errors if named else None,
        )
    )


def write_world(folder, name, transfer=True):
    rest = np.random.default_rng(len(name)).normal(0, 0.1, (1, POINTS, 3))
    times = np.arange(FRAMES) / 30
    for ending, along in (("", 0), (".transfer", 1)) if transfer else (("", 0),):
        points = (rest + np.outer(0.05 * np.sin(3 * times), np.eye(3)[along])[:, None]).astype(np.float32)
        np.savez(folder / f"{name}{ending}.npz", times=times, points=points, controllers=points[:, :1])


@pytest.fixture
def worlds(tmp_path):
    """Three worlds: wind, nothing, and one that no diagnosis survives."""
    folder = tmp_path / "worlds"
    folder.mkdir()
    for name in ("blown", "quiet", "odd"):
        write_world(folder, name, transfer=name != "quiet")
    labels = [label_of("blown", "wind"), label_of("quiet"), label_of("odd", "damage", magnitude=1.0)]
    (folder / "labels.json").write_text(json.dumps(labels))
    return folder


@pytest.fixture(name="said")
def _said():
    return said


@pytest.fixture(name="report_of")
def _report_of():
    return report_of


@pytest.fixture(name="label_of")
def _label_of():
    return label_of


@pytest.fixture(name="diagnosis_of")
def _diagnosis_of():
    return diagnosis_of
