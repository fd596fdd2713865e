import numpy as np
import pytest

from model.evaluation.consistency import consistency
from model.evaluation.records import PartRecord


@pytest.fixture
def records(make_record):
    def make(rows):
        """Rows of object, case, material, truth, estimate."""
        return [
            make_record(
                object_name=name,
                case=case,
                parts=[
                    PartRecord(
                        part=0, material=material, log_truth=truth, log_estimate=estimate, log_spread=None
                    )
                ],
            )
            for name, case, material, truth, estimate in rows
        ]

    return make


def test_spread_is_within_each_material(records):
    found = consistency(
        records(
            [
                ("a", "a-lift", "fabric", 1.0, 1.5),
                ("b", "b-lift", "fabric", 3.0, 3.5),
                ("c", "c-lift", "rubber", 10.0, 10.5),
                ("d", "d-lift", "rubber", 14.0, 14.5),
            ]
        )
    )
    # pooled: (1 + 1 + 4 + 4) / (4 values - 2 materials)
    assert found.over_scenes.value == pytest.approx(np.sqrt(5.0))
    assert found.truth_over_scenes.value == pytest.approx(np.sqrt(5.0))
    # the estimates follow the truth, all off by the same
    assert found.error_over_scenes.value == pytest.approx(0.0)
    assert found.over_interactions is None


def test_spread_over_the_clips_of_an_object(records):
    found = consistency(
        records(
            [
                ("a", "a-lift", "fabric", 1.0, 1.0),
                ("a", "a-drop", "fabric", 1.0, 3.0),
                ("b", "b-lift", "fabric", 9.0, 9.0),
                ("b", "b-drop", "fabric", 9.0, 9.0),
            ]
        )
    )
    assert found.over_interactions.value == pytest.approx(1.0)
    assert found.over_scenes.value > 3.0


def test_a_material_that_is_there_once_says_nothing(records):
    found = consistency(records([("a", "a-lift", "fabric", None, 1.0), ("b", "b-lift", "fur", None, 2.0)]))
    assert found.over_scenes is None
    assert found.truth_over_scenes is None


def test_two_recordings_of_one_thing_have_no_parts_in_common(records):
    """Each was reconstructed by itself: part 0 of one may be another part of the other."""
    names = ("single_lift_sloth", "double_lift_sloth")
    once = records([(name, name, "fur", None, 3.0 * place) for place, name in enumerate(names)])
    assert {record.thing for record in once} == {"sloth"}
    assert consistency(once).over_interactions is None
    twice = records(
        [(name, f"{name}-{turn}", "fur", None, 3.0 * p) for p, name in enumerate(names) for turn in "ab"]
    )
    assert consistency(twice).over_interactions.value == pytest.approx(0.0)
