import sys
from subprocess import run

import pytest

from worker.inspection import __main__ as inspection
from worker.kinds import ALL_KINDS, kind_called
from worker.queues import ALL_QUEUES


@pytest.mark.parametrize("kind", ALL_KINDS, ids=lambda kind: kind.name)
def test_every_kind_says_what_it_takes(kind):
    assert kind.queue in ALL_QUEUES
    assert 0 < kind.limit_s <= 3600
    assert kind.memory_bytes >= 1 << 30
    assert kind.options.model_json_schema()
    assert {each.inspection for each in kind.inputs.values()} <= set(inspection.ALL_INSPECTIONS)


def test_names_are_unique_and_found():
    assert len({kind.name for kind in ALL_KINDS}) == len(ALL_KINDS)
    assert kind_called("twin") in ALL_KINDS
    with pytest.raises(KeyError):
        kind_called("nothing")


def test_a_front_can_know_the_kinds_without_torch():
    code = (
        "import sys, worker.kinds, worker.queues, worker.storage; "
        "print(sorted({'torch', 'cv2', 'scipy'} & set(sys.modules)))"
    )
    assert run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
