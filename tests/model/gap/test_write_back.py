from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from model.bundle import TwinBundle
from model.gap.bodies.body import body_of
from model.gap.carried import CATALOGUE, record_of
from model.gap.diagnosis import Diagnosis
from model.gap.effects import BendingStiffness, QuadraticAirDrag, SelfContact, SteadyWind
from model.gap.given import given_twin
from model.gap.hypothesis import Hypothesis
from model.gap.matter import MASS
from model.gap.plain import PlainTwin
from model.gap.result import DiagnosisResult
from model.gap.slight_bending import slight_bending
from model.gap.write_back import cannot_act, twin_of, with_findings
from model.simulator.structure import rows, spans
from model.types import Observation, Parameter

DRAG = record_of(QuadraticAirDrag, {"drag_per_mass": 3.0, "facing": 0.5})


@pytest.fixture
def twin(twin_path) -> TwinBundle:
    bundle = TwinBundle.load(twin_path)
    free = {**bundle.parameters.globals, "collision_distance": Parameter(0.0, "m", "user")}
    return replace(bundle, parameters=replace(bundle.parameters, globals=free), preview=b"movie")


@pytest.fixture
def seen(twin) -> Observation:
    points = twin.rollout(substeps=100).points[:, ::2]
    return Observation(times=np.arange(5) / 30, points=points, controllers=twin.controls)


def starts(plain: PlainTwin, **others: float) -> dict[str, float]:
    return {name: quantity.start for name, quantity in plain.quantities.items()} | others


def predicted(plain: PlainTwin, values: dict[str, float]) -> np.ndarray:
    with torch.no_grad():
        world = plain.world({name: torch.tensor(value).double() for name, value in values.items()})
        return world.rollout(substeps=200).points.numpy()


class TestGiven:
    def test_the_effect_is_added_and_the_rest_stays(self, twin, seen, found, tmp_path):
        wind = record_of(SteadyWind, {"drag_per_mass": 1.0, "x": 1.0, "y": 0.0, "facing": 0.5})
        old = replace(
            twin, effects=(record_of(QuadraticAirDrag, {"drag_per_mass": 1.0, "facing": 0.5}), wind)
        )
        new = with_findings(old, seen, Diagnosis(found(seen, "quadratic_air_drag"), (DRAG,)))
        assert new.effects == (wind, DRAG)
        assert new.preview is None
        assert new.manifest.id != old.manifest.id
        assert new.manifest.stages[-1].name == "diagnosis"
        np.testing.assert_array_equal(new.parameters.stiffness, old.parameters.stiffness)
        np.testing.assert_array_equal(new.controls, old.controls)
        new.save(tmp_path / "new.twin.zip")
        assert TwinBundle.load(tmp_path / "new.twin.zip").effects == new.effects

    def test_parameters_that_were_fitted_with_it_come_along(self, twin, seen, found):
        plain = given_twin(twin, seen)
        values = starts(plain, gradient_1=0.4, prestress=0.5, drag_rate=2.0)
        values |= {"stiffness": 2.0 * values["stiffness"], "quadratic_air_drag.drag_per_mass": 3.0}
        new = with_findings(twin, seen, Diagnosis(found(seen), (), values))
        ours = {name: value for name, value in values.items() if "." not in name}
        np.testing.assert_allclose(new.rollout(substeps=200).points, predicted(plain, ours), atol=1e-5)
        drag = new.parameters.globals["drag_rate"]
        assert (drag.value, drag.unit, drag.source) == (pytest.approx(2.0), "1/s", "fitted")
        assert new.parameters.globals["friction"] == twin.parameters.globals["friction"]

    def test_a_coarser_fit_is_written_to_all_points(self, twin, seen, found):
        with pytest.warns(UserWarning, match="merged"):
            plain = given_twin(twin, seen, 20)
        count = len(plain.body.points)
        assert count < 27
        values = starts(plain)
        values["stiffness"] *= 3.0
        drag = DRAG.model_copy(update={"acts_on": tuple(np.linspace(0, 1, count))})
        new = with_findings(twin, seen, Diagnosis(found(seen), (drag,), values), 20)
        np.testing.assert_allclose(new.parameters.stiffness, 3.0 * twin.parameters.stiffness, rtol=1e-5)
        assert len(new.effects[0].acts_on) == 27
        assert set(new.effects[0].acts_on) == set(drag.acts_on)

    def test_what_goes_by_the_graph_is_written_as_the_finer_one_has_it(self, twin, seen, found):
        """Contact at as many metres; rows that resist as much in sum, the interval with them."""
        with pytest.warns(UserWarning, match="merged"):
            coarse = given_twin(twin, seen, 20)
        fine = given_twin(twin, seen, 27)
        contact = record_of(SelfContact, {"distance": 0.6, "friction": 0.3})
        stiff = {"bending_stiffness": 1e-4, "memory_of_shape": 0.5}
        bending = record_of(BendingStiffness, stiff, intervals={"bending_stiffness": (5e-5, 2e-4)})
        new = with_findings(twin, seen, Diagnosis(found(seen), (contact, bending), starts(coarse)), 20)
        apart = [
            np.median(np.linalg.norm(np.diff(one.body.points[one.body.springs], axis=1), axis=-1))
            for one in (coarse, fine)
        ]
        there = new.effects[0].parameters
        assert there["distance"]["value"] == pytest.approx(0.6 * apart[0] / apart[1])
        assert there["friction"] == contact.parameters["friction"]
        sums = [
            spans(one.body.points, rows(one.body.points, one.body.springs)).sum() for one in (coarse, fine)
        ]
        there = new.effects[1].parameters["bending_stiffness"]
        factor = sums[0] / sums[1]
        assert factor != pytest.approx(1.0, abs=0.01)
        assert there["value"] == pytest.approx(1e-4 * factor)
        assert there["ci95"] == pytest.approx([5e-5 * factor, 2e-4 * factor])
        assert there["unit"] == "N·m²"

    @pytest.mark.filterwarnings("ignore:the controllers do not start where:UserWarning")
    def test_another_hand_leaves_the_grip_of_the_twin(self, twin, seen, found):
        elsewhere = replace(seen, controllers=np.repeat(seen.points[:1, :1], 5, axis=0))
        plain = given_twin(twin, elsewhere)
        new = with_findings(twin, elsewhere, Diagnosis(found(seen), (DRAG,), starts(plain, grip=9.0)))
        np.testing.assert_array_equal(
            new.parameters.controller_stiffness, twin.parameters.controller_stiffness
        )

    @pytest.mark.parametrize(
        ("name", "values"),
        [
            ("gravity_tilt", {"about_x": 0.2, "about_y": 0.0}),
            ("mass_heterogeneity", {"excess": 1.0, "x": 0.5, "y": 0.5, "z": 0.5, "radius": 0.3}),
            ("actuation_delay", {"delay": 0.05}),
            ("quadratic_air_drag", {"drag_per_mass": 1.0, "facing": 0.5}),
        ],
    )
    def test_what_is_carried_already_acts_as_it_was_fitted(self, twin, seen, found, name, values):
        """On top of the carried effect or instead of it: as a world of the fit has it."""
        effect = CATALOGUE[name]
        old = replace(twin, effects=(record_of(effect, values),))
        plain = given_twin(old, seen)
        with torch.no_grad():
            start = {n: torch.tensor(v).double() for n, v in starts(plain).items()}
            own = {n: torch.tensor(v).double() for n, v in values.items()}
            expected = effect().apply(plain.world(start), own).rollout(substeps=200).points.numpy()
        new = with_findings(old, seen, Diagnosis(found(seen), (record_of(effect, values),), starts(plain)))
        np.testing.assert_allclose(new.rollout(substeps=200).points, expected, atol=1e-5)

    def test_the_place_is_that_of_the_recording(self, twin, seen, found):
        """Effects were fitted under its gravity and over its ground, and are nothing elsewhere."""
        tilted = replace(seen, gravity=(0.0, 1.7, -9.66), ground_height=-1.0)
        with pytest.warns(UserWarning, match="the observation's word counts"):
            given_twin(twin, tilted)
        new = with_findings(twin, tilted, Diagnosis(found(seen), (DRAG,)))
        assert new.parameters.globals["gravity"].value == pytest.approx((0.0, 1.7, -9.66), abs=1e-6)
        assert new.parameters.globals["ground_height"].value == pytest.approx(-1.0, abs=1e-6)
        stuck = record_of(CATALOGUE["adhesion"], {"pull_per_mass": 50.0, "reach": 0.01, "at_contact": 0.0})
        assert cannot_act(with_findings(twin, tilted, Diagnosis(found(seen), (stuck,)))) is None
        assert "there is no ground" in str(
            cannot_act(with_findings(twin, seen, Diagnosis(found(seen), (stuck,))))
        )

    def test_what_cannot_act_in_the_twin_is_not_written(self, twin, seen, found):
        stuck = record_of(CATALOGUE["adhesion"], {"pull_per_mass": 50.0, "reach": 0.01, "at_contact": 0.0})
        result = DiagnosisResult(Diagnosis(found(seen), (stuck,)), seen, given_twin(twin, seen), twin)
        with pytest.warns(UserWarning, match="no twin was written: .*there is no ground"):
            assert result.twin() is None


class TestMade:
    @pytest.fixture
    def hung(self) -> Observation:
        """A strip of cloth, held at one end, one point never seen, with colours and a ground."""
        u, v = np.meshgrid(np.linspace(0, 0.3, 9), np.linspace(0, 0.1, 4), indexing="ij")
        places = np.stack([u, v, 1 - 0.2 * u], -1).reshape(-1, 3).astype(np.float32)
        points = np.repeat(places[None], 6, 0)
        points[:, 7] = np.nan
        hand = np.repeat(places[None, :4], 6, 0)
        hand[..., 1] += np.linspace(0, 0.05, 6, dtype=np.float32)[:, None]
        colors = np.tile(np.array([[255, 0, 51]], np.uint8), (len(places), 1))
        return Observation(np.arange(6) / 25, points, hand, ground_height=0.5, colors=colors)

    @pytest.mark.filterwarnings("ignore:the controllers do not start where:UserWarning")
    def test_is_what_it_came_as_in_any_hand(self, hung, found):
        """Held elsewhere, how it is held is a guess and what it is made of is not: it bends as it came."""
        made = twin_of(hung, Diagnosis(found(hung), ()), PlainTwin.of(body_of(hung), hung))
        elsewhere = replace(hung, controllers=np.repeat(hung.points[:, -1:], 1, axis=1))
        for seen in (hung, elsewhere):
            plain = given_twin(made, seen)
            world = Hypothesis(plain).at(starts(plain))
            assert plain.given
            assert "slight_bending" not in world.simulator.forces
            assert {"tension_only", "bending"} <= set(world.simulator.forces)

    def test_moves_as_what_was_diagnosed(self, hung, found, tmp_path):
        plain = PlainTwin.of(body_of(hung), hung)
        values = starts(plain, drag_rate=1.5, bending=0.2, bending_decay=70.0)
        made = twin_of(hung, Diagnosis(found(hung), (DRAG,), values), plain)
        made.save(tmp_path / "made.twin.zip")
        twin = TwinBundle.load(tmp_path / "made.twin.zip")
        assert twin.effects[-1] == DRAG
        # any cloth has both
        assert [effect.name for effect in twin.effects[:-1]] == ["tension_only", "bending_stiffness"]
        assert twin.manifest.source.fps == pytest.approx(25.0)
        assert twin.parameters.globals["ground_height"].value == 0.5
        assert twin.parameters.globals["bending_decay"] == Parameter(70.0, "1/s", "fitted")
        bare = replace(twin, effects=twin.effects[:-1])
        np.testing.assert_allclose(bare.rollout(substeps=200).points, predicted(plain, values), atol=2e-5)
        assert np.abs(twin.rollout(substeps=200).points - bare.rollout(substeps=200).points).max() > 1e-5

    def test_a_cloth_that_is_found_to_resist_bending_resists_the_slight_part_too(self, hung, found):
        """As one hinge, which moves as the diagnosed world does that has two."""
        plain = PlainTwin.of(body_of(hung), hung)
        values = {"bending_stiffness": 3e-6, "memory_of_shape": 0.3}
        made = twin_of(hung, Diagnosis(found(hung), (record_of(BendingStiffness, values),)), plain)
        slack, record = made.effects
        assert slack.name == "tension_only"
        slight = starts(plain)["bending"] * float(
            slight_bending(plain.body, MASS * 9.81).value("bending_stiffness").max()
        )
        assert record.parameters["bending_stiffness"]["value"] == pytest.approx(3e-6 + slight)
        assert 0.3 < record.parameters["memory_of_shape"]["value"] < 1.0
        world = Hypothesis(plain, (BendingStiffness(),)).at(
            {**starts(plain), **{f"bending_stiffness.{name}": value for name, value in values.items()}}
        )
        with torch.no_grad():
            expected = world.rollout(substeps=200).points.numpy()
            plainly = predicted(plain, starts(plain))
        assert np.abs(expected - plainly).max() > 1e-4
        np.testing.assert_allclose(made.rollout(substeps=200).points, expected, atol=2e-5)

    def test_a_thick_rope_remembers_as_much_of_its_first_shape_as_was_fitted(self, found, thick_rope):
        seen, _ = thick_rope(1, lying=True)
        plain = PlainTwin.of(body_of(seen, "rope"), seen)
        values = starts(plain, memory_of_shape=0.2)
        (start,) = twin_of(seen, Diagnosis(found(seen), ()), plain).effects
        assert start.parameters["memory_of_shape"]["value"] == starts(plain)["memory_of_shape"] < 1.0
        (own,) = twin_of(seen, Diagnosis(found(seen), (), values), plain).effects
        assert own.name == "bending_stiffness"
        assert own.parameters["memory_of_shape"]["value"] == 0.2
        stiff = own.parameters["bending_stiffness"]["value"]
        more = record_of(BendingStiffness, {"bending_stiffness": stiff, "memory_of_shape": 1.0})
        (both,) = twin_of(seen, Diagnosis(found(seen), (more,), values), plain).effects
        assert both.parameters["bending_stiffness"]["value"] == pytest.approx(2 * stiff)
        assert both.parameters["memory_of_shape"]["value"] == pytest.approx(0.6)

    def test_bending_found_at_its_bound_stays_within_it(self, hung, found, tmp_path):
        plain = PlainTwin.of(body_of(hung), hung)
        values = {"bending_stiffness": 1.0, "memory_of_shape": 1.0}
        made = twin_of(hung, Diagnosis(found(hung), (record_of(BendingStiffness, values),)), plain)
        assert made.effects[1].parameters["bending_stiffness"]["value"] == 1.0
        assert made.effects[1].parameters["memory_of_shape"]["value"] == 1.0
        made.save(tmp_path / "stiff.twin.zip")

    def test_what_cannot_act_together_is_not_written(self, hung, found):
        """A diagnosis does not fit such a pair: no twin is written that nobody can simulate."""
        laws = [CATALOGUE["damage"], CATALOGUE["plasticity"]]
        pair = tuple(record_of(law, {name: q.start for name, q in law.quantities.items()}) for law in laws)
        plain = PlainTwin.of(body_of(hung), hung)
        for records in (pair, pair[::-1]):
            result = DiagnosisResult(Diagnosis(found(hung), records), hung, plain)
            with pytest.warns(UserWarning, match=f"no twin was written: .*{records[1].name} cannot act"):
                assert result.twin() is None
        made = DiagnosisResult(Diagnosis(found(hung), pair[:1]), hung, plain).twin()
        assert made is not None
        assert made.effects[-1] == pair[0]

    def test_looks_like_what_was_seen(self, hung, found):
        plain = PlainTwin.of(body_of(hung), hung)
        made = twin_of(hung, Diagnosis(found(hung), (DRAG,)), plain)
        assert len(made.gaussians) == hung.points.shape[1] - 1
        np.testing.assert_allclose(made.gaussians.colors[0], [1, 0, 0.2], atol=1e-6)
        assert 0.005 < made.gaussians.scales.min() <= made.gaussians.scales.max() < 0.04

    def test_nothing_is_held_where_there_is_no_hand(self, hung, found, tmp_path):
        fallen = replace(hung, controllers=np.zeros((6, 0, 3), np.float32), ground_height=None, colors=None)
        plain = PlainTwin.of(body_of(fallen), fallen)
        made = twin_of(fallen, Diagnosis(found(fallen), (DRAG,)), plain)
        made.save(tmp_path / "made.twin.zip")
        twin = TwinBundle.load(tmp_path / "made.twin.zip")
        assert twin.controls is None
        assert "ground_height" not in twin.parameters.globals
        assert twin.rollout(substeps=50).points[-1, :, 2].mean() < twin.topology.points[:, 2].mean() - 0.1

    def test_a_thick_rope_lies_where_it_lay(self, found, thick_rope, tmp_path):
        seen, _ = thick_rope(1, lying=True)
        plain = PlainTwin.of(body_of(seen, "rope"), seen)
        made = twin_of(seen, Diagnosis(found(seen), ()), plain)
        assert plain.ground_height == plain.body.above > 0.006
        assert made.parameters.globals["ground_height"].value == plain.ground_height
        again = given_twin(made, seen)
        assert again.body.aside is not None
        assert again.ground_height == pytest.approx(plain.ground_height, abs=2e-3)


def test_a_gradient_that_was_fitted_to_a_coarser_twin_leads_the_same_way():
    """Axes of a body have no sign of their own: another order of points turns them about."""
    sides = (np.arange(n) * 0.02 for n in (20, 10, 5))
    places = np.stack(np.meshgrid(*sides, indexing="ij"), -1).reshape(-1, 3)
    seen = np.repeat(places[None].astype(np.float32), 2, axis=0)
    still = Observation(np.arange(2) / 30, seen, np.zeros((2, 0, 3), np.float32))
    coarse = PlainTwin.of(body_of(still), still)
    values = {"gradient_1": torch.tensor(1.0), "gradient_2": torch.tensor(0.0)}

    def softer(plain: PlainTwin) -> float:
        """Towards which end stiffness grows, -1 or 1."""
        middle = plain.body.points[plain.body.springs].mean(1)[:, 0]
        return float(np.sign(np.corrcoef(middle, plain._gradient(values).numpy())[0, 1]))

    for seed in range(4):
        points = places[np.random.default_rng(seed).permutation(len(places))]
        near = cKDTree(points).query_pairs(0.021, output_type="ndarray").astype(np.int64)
        share = np.full(len(points), 1.0 / len(points))
        body = replace(coarse.body, points=points, springs=near, share=share)
        fine = replace(coarse, body=body, along=coarse.body)
        assert softer(fine) == softer(coarse)
