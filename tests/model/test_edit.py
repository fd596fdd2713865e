from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from model.bundle import TwinBundle
from model.cli import matphys
from model.edit import edit_part, predictor_of
from model.errors import InputError
from model.imagine import imagine
from model.predictor.prior_mean import PriorMeanPredictor
from model.predictor.trained import TrainedPredictor
from model.priors.materials import MATERIALS, typical
from model.schema import PartRecord, PropertyRecord, StageRecord
from model.simulator.divergence import SimulationDiverged
from model.types import MaterialPrior, Parameter

GRAVITY = (0.0, 0.0, -9.81)


@pytest.fixture
def twin(twin_path) -> TwinBundle:
    """A cube of fabric in two parts, its springs predicted as the pipeline does."""
    bundle = TwinBundle.load(twin_path)
    properties = typical("fabric", "solid")
    fabric = np.array([float(name == "fabric") for name in MATERIALS])
    records = tuple(
        PartRecord(
            label=number,
            materials=dict(zip(MATERIALS, fabric.tolist(), strict=True)),
            prior={
                name: PropertyRecord(mean=belief.mean, spread=belief.spread, unit=belief.unit)
                for name, belief in properties.items()
            },
        )
        for number in range(2)
    )
    priors = [MaterialPrior(fabric, properties, "solid")] * 2
    predicted = PriorMeanPredictor().from_priors(bundle.topology, priors, "solid", GRAVITY, None)
    return replace(bundle, parts=records, parameters=predicted)


@pytest.fixture(scope="module")
def network():
    return TrainedPredictor()


@pytest.fixture
def learned(twin, network) -> TwinBundle:
    """The same, as a twin whose mechanics a network has predicted."""
    made = StageRecord(name="parameters", method="matphys", version="1", weights=network.weights)
    entries = {
        name: replace(entry, source="predicted")
        if name in ("dashpot_damping", "drag_rate", "friction", "restitution")
        else entry
        for name, entry in twin.parameters.globals.items()
    }
    manifest = twin.manifest.model_copy(update={"stages": (made,)})
    return replace(twin, manifest=manifest, parameters=replace(twin.parameters, globals=entries))


def test_the_springs_of_the_part_are_the_predictors_and_the_others_stay(twin):
    after = edit_part(twin, 1, "rubber", "solid")
    inside = twin.topology.part == 1
    touched = inside[twin.topology.springs].any(axis=1)
    assert 0 < touched.sum() < len(touched)
    np.testing.assert_array_equal(after.parameters.stiffness[~touched], twin.parameters.stiffness[~touched])
    priors = [
        MaterialPrior(np.eye(10)[MATERIALS.index(name)], typical(name, "solid"), "solid")
        for name in ("fabric", "rubber")
    ]
    expected = PriorMeanPredictor().from_priors(after.topology, priors, "solid", GRAVITY, None)
    np.testing.assert_array_equal(after.parameters.stiffness[touched], expected.stiffness[touched])
    assert after.parameters.stiffness[touched].mean() > 5 * twin.parameters.stiffness[touched].mean()


def test_the_part_weighs_what_rubber_weighs(twin):
    after, inside = edit_part(twin, 1, "rubber", "solid"), twin.topology.part == 1
    ratio = typical("rubber", "solid")["density"].mean / typical("fabric", "solid")["density"].mean
    np.testing.assert_allclose(after.topology.mass[inside], ratio * twin.topology.mass[inside], rtol=1e-6)
    np.testing.assert_array_equal(after.topology.mass[~inside], twin.topology.mass[~inside])


def test_a_part_made_of_what_it_was_stays_as_it_was(twin):
    after = edit_part(twin, 0, "fabric", "solid")
    np.testing.assert_array_equal(after.parameters.stiffness, twin.parameters.stiffness)
    np.testing.assert_array_equal(after.topology.mass, twin.topology.mass)


def test_what_was_fitted_or_given_stays(twin):
    fitted = Parameter(0.77, "1/s", "fitted")
    known = replace(twin.parameters, globals=twin.parameters.globals | {"drag_rate": fitted})
    after = edit_part(replace(twin, parameters=known), 1, "paper", "solid")
    assert after.parameters.globals["drag_rate"] is fitted
    assert after.parameters.globals["friction"].value != twin.parameters.globals["friction"].value


def test_the_twin_says_so_loads_and_moves(twin, tmp_path):
    after = edit_part(twin, 1, "rubber", "solid")
    after.save(tmp_path / "new.twin.zip")
    again = TwinBundle.load(tmp_path / "new.twin.zip")
    assert again.parts[1].materials["rubber"] == 1
    assert again.parts[0].materials["fabric"] == 1
    assert again.parts[1].stiffness.mean > again.parts[0].stiffness.mean
    assert "part 1 was made rubber by its user" in again.manifest.warnings
    assert again.manifest.id != twin.manifest.id
    assert np.isfinite(again.rollout().points).all()


def test_a_network_that_made_the_twin_is_asked_again(learned, network):
    assert predictor_of(learned).weights == network.weights
    means, after = (edit_part(learned, 1, "rubber", "solid", asked) for asked in (None, network))
    inside = learned.topology.part == 1
    touched = inside[learned.topology.springs].any(axis=1)
    priors = [
        MaterialPrior(np.eye(10)[MATERIALS.index(name)], typical(name, "solid"), "solid")
        for name in ("fabric", "rubber")
    ]
    expected = network(imagine(means, priors, "solid"))
    np.testing.assert_allclose(after.parameters.stiffness[touched], expected.stiffness[touched], rtol=1e-4)
    np.testing.assert_array_equal(
        after.parameters.stiffness[~touched], learned.parameters.stiffness[~touched]
    )
    assert not np.allclose(means.parameters.stiffness[touched], expected.stiffness[touched], rtol=1e-2)
    assert after.parameters.stiffness[touched].mean() > 3 * learned.parameters.stiffness[touched].mean()
    assert after.parameters.globals["friction"].source == "predicted"
    assert after.parameters.globals["friction"].value == pytest.approx(
        expected.globals["friction"].value, rel=1e-4
    )
    last = after.manifest.stages[-1]
    assert (last.name, last.method, last.weights) == ("edit", "matphys", network.weights)


def test_motion_that_says_nothing_leaves_the_means_and_a_warning(learned, network):
    short = replace(learned, controls=learned.controls[:3])
    after, means = (edit_part(short, 1, "rubber", "solid", asked) for asked in (network, None))
    np.testing.assert_array_equal(after.parameters.stiffness, means.parameters.stiffness)
    assert after.manifest.stages[-1].method == "prior-mean"
    assert after.manifest.warnings[-1] == (
        "edit: the prior's means are used, not matphys: "
        "motion: 3 frames to look at: expected at least 4 of the 3"
    )


def test_a_network_that_cannot_tell_is_named_with_its_reason(learned, network, monkeypatch):
    def diverge(self, case, images=None):
        raise SimulationDiverged(3, 7, "spring", 100)

    monkeypatch.setattr(TrainedPredictor, "__call__", diverge)
    said = edit_part(learned, 1, "rubber", "solid", network).manifest.warnings[-1]
    assert said.startswith(
        "edit: the prior's means are used, not matphys: the simulation diverged in frame 3"
    )


def test_springs_of_two_predictors_are_told(learned, network):
    other = learned.manifest.stages[0].model_copy(update={"weights": "0" * 64})
    mixed = replace(learned, manifest=learned.manifest.model_copy(update={"stages": (other,)}))
    line = "edit: the other springs are from another predictor (000000000000)"
    assert line in edit_part(mixed, 1, "rubber", "solid", network).manifest.warnings
    assert line not in edit_part(learned, 1, "rubber", "solid", network).manifest.warnings


def test_the_means_are_asked_where_a_network_did_not_make_the_twin(twin):
    assert isinstance(predictor_of(twin), PriorMeanPredictor)
    means, after = (edit_part(twin, 1, "rubber", "solid", asked) for asked in (None, predictor_of(twin)))
    np.testing.assert_array_equal(after.parameters.stiffness, means.parameters.stiffness)
    assert after.manifest.stages[-1].method == "prior-mean"
    assert after.manifest.warnings == means.manifest.warnings


@pytest.mark.parametrize(
    ("part", "material", "line"),
    [
        (2, "rubber", "--part 2: the parts of this twin are 0 to 1"),
        (0, "stone", "--material stone: choose one of"),
    ],
)
def test_what_there_is_not_is_refused(twin, part, material, line):
    with pytest.raises(InputError, match=line):
        edit_part(twin, part, material)


@pytest.mark.parametrize("lone", [True, False], ids=["a part without points", "a twin without springs"])
def test_a_part_that_no_spring_touches_is_refused_and_nothing_written(twin, tmp_path, run, lone):
    if lone:
        bare = replace(twin, topology=replace(twin.topology, part=np.zeros_like(twin.topology.part)))
    else:
        loose = replace(twin.topology, springs=twin.topology.springs[:0], rest_length=np.zeros(0, np.float32))
        strength = replace(twin.parameters, stiffness=np.zeros(0, np.float32))
        bare = replace(twin, topology=loose, parameters=strength)
    bare.save(tmp_path / "old.twin.zip")
    arguments = ("--part", 1, "--material", "rubber", "--out", tmp_path / "new.twin.zip", "--json")
    outcome = run("edit", tmp_path / "old.twin.zip", *arguments)
    assert outcome.code == 2
    assert (
        outcome.line == "matphys: --part 1: no spring of the twin touches it: choose a part that has springs"
    )
    assert not (tmp_path / "new.twin.zip").exists()


def test_a_twin_that_does_not_say_what_it_is_made_of_is_refused(twin):
    silent = tuple(part.model_copy(update={"prior": {}}) for part in twin.parts)
    with pytest.raises(InputError, match="part 0 has no prior of its stiffness"):
        edit_part(replace(twin, parts=silent), 1, "rubber", "solid")


def test_the_command_says_what_it_did(twin, tmp_path):
    twin.save(tmp_path / "old.twin.zip")
    arguments = ["edit", str(tmp_path / "old.twin.zip"), "--part", "1", "--material", "rubber"]
    result = CliRunner().invoke(
        matphys, [*arguments, "--out", str(tmp_path / "new.twin.zip"), "--shape", "solid"]
    )
    assert result.exit_code == 0, result.output
    assert "springs of part 1" in result.stdout
    made = TwinBundle.load(tmp_path / "new.twin.zip")
    assert made.parts[1].materials["rubber"] == 1
    assert made.manifest.stages[-1].method == "prior-mean"


@pytest.mark.parametrize(("who", "method"), [("auto", "matphys"), ("prior-mean", "prior-mean")])
def test_the_command_asks_whom_the_user_says(learned, tmp_path, who, method):
    learned.save(tmp_path / "old.twin.zip")
    arguments = ["edit", str(tmp_path / "old.twin.zip"), "--part", "1", "--material", "rubber"]
    arguments += ["--out", str(tmp_path / "new.twin.zip"), "--shape", "solid", "--predictor", who]
    result = CliRunner().invoke(matphys, arguments)
    assert result.exit_code == 0, result.output
    assert TwinBundle.load(tmp_path / "new.twin.zip").manifest.stages[-1].method == method


def test_the_command_says_whom_it_may_ask(twin, tmp_path):
    twin.save(tmp_path / "old.twin.zip")
    arguments = ["edit", str(tmp_path / "old.twin.zip"), "--part", "1", "--material", "rubber"]
    arguments += ["--out", str(tmp_path / "new.twin.zip"), "--predictor", "oracle"]
    with pytest.raises(InputError, match=r"--predictor oracle: choose auto, matphys, prior-mean, or a \."):
        CliRunner().invoke(matphys, arguments, catch_exceptions=False)
