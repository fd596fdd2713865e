"""A folder of small cases: two objects in two interactions each."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from model.evaluation.records import PartRecord, Record, Transfer
from model.scenes.case import Case
from model.scenes.files import save_case, write_index
from model.types import Gaussians


@pytest.fixture(scope="session")
def object_cases(make_case: Callable[..., Case]) -> Callable[..., list[Case]]:
    """Makes the cases of one object: `object_cases(seed, object_class=…, frames=…)`, a lift and a push."""

    def make(seed: int, object_class: str = "foam", frames: int = 12) -> list[Case]:
        lifts = {"lift": 0.25, "push": 0.12}
        return [
            replace(
                make_case(seed=seed, frames=frames, lift=lift, modulus=(4e3 * (1 + seed), 4e4)),
                name=f"bar-{seed}-{interaction}",
                object_class=object_class,
                interaction=interaction,
            )
            for interaction, lift in lifts.items()
        ]

    return make


@pytest.fixture(scope="session")
def case_folder(object_cases: Callable[..., list[Case]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder, indexed."""
    folder = tmp_path_factory.mktemp("cases")
    for seed, object_class in ((0, "foam"), (1, "cloth")):
        for case in object_cases(seed, object_class):
            save_case(case, folder / f"{case.name}.case.npz")
    write_index(folder, seed=0)
    return folder


@pytest.fixture(scope="session")
def dressed(make_case: Callable[..., Case]) -> Case:
    """A case with looks: a Gaussian at each observed point, red on the left and blue on the right."""
    case = make_case(frames=10)
    count = len(case.rest)
    left = case.rest[:, :1] < np.median(case.rest[:, 0])
    looks = Gaussians(
        means=case.rest,
        scales=np.full((count, 3), 0.008, np.float32),
        quaternions=np.tile(np.array([1.0, 0, 0, 0], np.float32), (count, 1)),
        opacities=np.full(count, 0.95, np.float32),
        colors=np.where(left, [0.9, 0.1, 0.1], [0.1, 0.1, 0.9]).astype(np.float32),
        volumes=np.full(count, 1e-6, np.float32),
    )
    bindings = {
        "binding_index": np.zeros((count, 4), np.int32),
        "binding_weight": np.full((count, 4), 0.25, np.float32),
    }
    return replace(case, gaussians=looks, topology=replace(case.topology, **bindings))


@pytest.fixture(scope="session")
def make_record() -> Callable[..., Record]:
    """Makes records: `make_record(method=…, object_name=…, track=…, …)`; all scores are `track` [m]."""

    def make(
        method: str = "ours",
        object_name: str = "a",
        case: str | None = None,
        track: float = 0.01,
        parts: Sequence[PartRecord] = (),
        **changes: object,
    ) -> Record:
        scores = {"chamfer": track / 2.0, "track": track, "matched": track}
        case = case or f"{object_name}-lift"
        record = Record(
            key=f"{method} {case}",
            method=method,
            identity="1",
            case=case,
            object_name=object_name,
            object_class="foam",
            interaction="lift",
            priors="right",
            known_object=False,
            fit_seconds=1.0,
            predict_seconds=0.1,
            failed=None,
            reconstruction=scores,
            future={name: 2.0 * value for name, value in scores.items()},
            unseen=[
                Transfer(
                    case=f"{object_name}-drop",
                    interaction="drop",
                    scores={name: 3.0 * value for name, value in scores.items()},
                )
            ],
            curve=[0.0, track, 2.0 * track],
            parts=list(parts),
            globals={},
        )
        return record.model_copy(update=changes)

    return make
