"""Folders of cases as batches: generated where there are none, described once, told apart by object."""

import hashlib
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from pytorch_lightning import LightningDataModule
from torch.utils.data import DataLoader, Dataset, Sampler

from model.encoders.kinematic import KinematicEncoder
from model.encoders.motion import MotionEncoder
from model.errors import InputError
from model.predictor.batches import Batch, Example, make_batch, true_values
from model.predictor.checkpoint import KNOWN, LEFT_OUT, names_text
from model.predictor.checks import at_least
from model.predictor.geometry import Geometry, describe_geometry
from model.predictor.motion_features import MotionFeatures
from model.predictor.motion_store import read_motion, store_motion
from model.predictor.object_split import check_fold, left_out, split_objects
from model.predictor.sample import Sample, make_sample
from model.progress import progress
from model.scenes.case import Case
from model.scenes.files import INDEX, CaseIndex, IndexEntry, describe, load_case, read_index
from model.scenes.generate import generate
from model.scenes.generated_name import GeneratedName
from model.scenes.object_group import object_group
from model.scenes.priors import Opinion, with_priors

TYPICAL = 256
"""Training cases that say how large inputs usually are."""


@dataclass(frozen=True)
class Opinions:
    """How often a material expert is right, undecided, or as often wrong as `wrong_probability` says."""

    right: float = 0.5
    uniform: float = 0.25
    wrong: float = 0.25
    wrong_probability: float = 0.3

    def __post_init__(self) -> None:
        """Refuse what is no share.

        Raises:
            InputError: see the message.
        """
        shares = {"right": self.right, "uniform": self.uniform, "wrong": self.wrong}
        if min(shares.values()) < 0.0 or not sum(shares.values()) > 0.0:
            raise InputError(f"data.opinions: {shares}: expected none below 0, and not all 0")
        if not 0.0 <= self.wrong_probability <= 1.0:
            raise InputError(f"data.opinions.wrong_probability is {self.wrong_probability}: expected 0 to 1")

    def draw(self, rng: np.random.Generator) -> Opinion:
        """One of the three."""
        shares = np.array([self.right, self.uniform, self.wrong], np.float64)
        names: tuple[Opinion, ...] = ("right", "uniform", "wrong")
        return names[int(rng.choice(3, p=shares / shares.sum()))]


@dataclass(frozen=True)
class Look:
    """A case under an opinion; which case, and everything that is drawn by lot, is in here."""

    index: int
    opinion: Opinion | None
    """None: the priors that are stored with the case."""
    seed: tuple[int, ...] = ()


class CaseDataset(Dataset[Example]):
    """Cases in memory, without what training does not look at; an example depends on its `Look` alone."""

    def __init__(self, paths: Sequence[Path], encoder: MotionEncoder, opinions: Opinions) -> None:
        """Read cases and what `store_motion` has kept of them.

        Raises:
            InputError: a file is no case, or has not been described.
        """
        self._cases = [replace(load_case(path), gaussians=None) for path in paths]
        self._motion = [read_motion(path, encoder) for path in paths]
        self._geometry: dict[int, Geometry] = {}
        self._opinions = opinions

    def __len__(self) -> int:
        """The number of cases."""
        return len(self._cases)

    def __getitem__(self, look: Look) -> Example:
        """A case with the priors of an opinion."""
        case = self._cases[look.index]
        if look.opinion is not None and case.truth is not None:
            rng = np.random.default_rng(look.seed)
            case = with_priors(case, look.opinion, rng, self._opinions.wrong_probability)
        example = example_of(case, self._motion[look.index], self._shape(look.index))
        return replace(example, opinion=look.opinion if case.truth is not None else None)

    def _shape(self, index: int) -> Geometry:
        if index not in self._geometry:
            self._geometry[index] = shape_of(self._cases[index])
        return self._geometry[index]


def example_of(case: Case, motion: MotionFeatures, geometry: Geometry | None = None) -> Example:
    """A case with its own priors, as the network sees it."""
    seen = case.observation
    sample = make_sample(
        case.topology,
        case.priors,
        case.shape_class,
        seen.gravity,
        seen.ground_height,
        motion,
        geometry=geometry or shape_of(case),
    )
    return Example(case, sample, true_values(case, len(case.priors)))


def shape_of(case: Case) -> Geometry:
    """The geometry of a case, which does not depend on its priors."""
    return describe_geometry(
        case.topology, len(case.priors), case.shape_class, case.observation.ground_height
    )


class Draws(Sampler[Look]):
    """Every case once per epoch, in an order and under opinions that the epoch and the seed fix."""

    def __init__(self, count: int, opinions: Opinions, seed: int, rank: int = 0, ranks: int = 1) -> None:
        """Of `count` cases; each of several processes gets as many of them as every other."""
        self._count, self._opinions, self._seed = count, opinions, seed
        self._rank, self._ranks, self._epoch = rank, ranks, 0

    def set_epoch(self, epoch: int) -> None:
        """Lightning says at the start of each epoch which one it is."""
        self._epoch = epoch

    def __len__(self) -> int:
        """Of this process."""
        return -(-self._count // self._ranks)

    def __iter__(self) -> Iterator[Look]:
        """The looks of this process in this epoch."""
        order = np.random.default_rng((self._seed, self._epoch)).permutation(self._count)
        for index in np.resize(order, len(self) * self._ranks)[self._rank :: self._ranks]:
            seed = (self._seed, self._epoch, int(index))
            yield Look(int(index), self._opinions.draw(np.random.default_rng(seed)), (*seed, 1))


def _say_other(index: CaseIndex, folder: Path, objects: int, seed: int) -> None:
    """Warn that generated objects which are there already are not those that are asked for."""
    if index.seed is None:
        return
    found = len({entry.object_name for entry in index.cases})
    if found != objects or index.seed != seed:
        warnings.warn(
            f"{folder} has {found} objects of seed {index.seed} already, and they are taken: data.objects is "
            f"{objects} and data.seed {seed} (of which worlds that diverge are left out); give another "
            "data.folder to make others",
            stacklevel=2,
        )


class CaseDataModule(LightningDataModule):
    """Cases for training, validation, test and prediction.

    Objects of the validation are none of the training's. Both are under the three opinions: in training drawn
    anew each epoch, in validation and test each case once under each, the same in every run.

    Args:
        folder: Cases as `matphys scenes` writes them.
        test_folder: Cases for `test` and `predict`, which then read no others; None: `test` has those of the
            fold that is left out, or else of the validation, `predict` all.
        encoder: What describes motion; None: the embedded one.
        objects: How many to generate into `folder` where it has no cases yet; 0: none, cases must be there.
        seed: Of generation, split and opinions.
        validation_share: Of the objects of each class.
        opinions: What training is told of materials.
        batch_size: Cases, of any sizes.
        workers: Processes that generate cases and describe motion.
        folds: Into how many groups of objects the folder is split, one of which is left out of training and
            validation, for `test` and `matphys evaluate`; as many as objects: one is left out; 0: none.
        fold: Which of them, from 0 on.
    """

    def __init__(
        self,
        folder: Path,
        *,
        test_folder: Path | None = None,
        encoder: MotionEncoder | None = None,
        objects: int = 0,
        seed: int = 0,
        validation_share: float = 0.15,
        opinions: Opinions = Opinions(),
        batch_size: int = 16,
        workers: int = 1,
        folds: int = 0,
        fold: int = 0,
    ) -> None:
        """See the class."""
        super().__init__()
        if not 0.0 < validation_share < 1.0:
            raise InputError(f"data.validation_share is {validation_share}: expected a share between 0 and 1")
        at_least(1, "data", batch_size=batch_size, workers=workers)
        at_least(0, "data", objects=objects, seed=seed)
        if objects == 1:
            raise InputError("data.objects is 1: expected 2 or more, so that one can be held out; 0: none")
        check_fold(folds, fold)
        self.folder, self.test_folder = folder, test_folder
        self.encoder = encoder or KinematicEncoder()
        self.motion_dim, self.motion_global_dim = self.encoder.dim, self.encoder.global_dim
        self._objects, self.seed, self._share = objects, seed, validation_share
        self._opinions, self._batch_size, self._workers = opinions, batch_size, workers
        self._folds, self._fold = folds, fold
        self._train: CaseDataset | None = None
        self._held: CaseDataset | None = None

    def prepare_data(self) -> None:
        """Generate and describe what is missing of what is read; in one process, before all others."""
        folder = self._read_by("fit" if self.trainer is None else self.trainer.state.fn or "fit")
        with progress(quiet=False) as report:
            if self._objects and folder == self.folder and not (folder / INDEX).exists():
                generate(folder, self._objects, self.seed, workers=self._workers, report=report)
            elif self._objects and folder == self.folder:
                _say_other(describe(folder), folder, self._objects, self.seed)
            store_motion(read_index(folder), self.encoder, self._workers, report)

    def setup(self, stage: str) -> None:
        """Read what the stage needs.

        Raises:
            InputError: there are no cases for it, or one cannot be read.
        """
        if stage == "predict" or (stage == "test" and self.test_folder is not None):
            folder = self._read_by(stage)
            paths = read_index(folder, verify=False)
            if not paths:
                raise InputError(f"{folder / INDEX}: names no cases: expected at least one")
            self._held = self._read(paths)
        elif stage == "test" and self._folds:
            own, apart = self._known(), describe(self.folder).cases
            self._held = self._read([self.folder / entry.file for entry in apart if entry not in own])
        else:
            train, held = split_objects(self._known(), self._share, self.seed)
            self._held = self._read([self.folder / entry.file for entry in held])
            if stage == "fit":
                self._train = self._read([self.folder / entry.file for entry in train])

    def train_dataloader(self) -> DataLoader[Example]:
        """Cases in an order of their own each epoch."""
        rank, ranks = self._ranks()
        data = _there(self._train)
        return self._loader(data, Draws(len(data), self._opinions, self.seed, rank, ranks))

    def val_dataloader(self) -> DataLoader[Example]:
        """Held-out objects, each case under each opinion."""
        rank, ranks = self._ranks()
        return self._loader(_there(self._held), self.fixed_looks()[rank::ranks])

    def test_dataloader(self) -> DataLoader[Example]:
        """The same, of the test cases."""
        return self.val_dataloader()

    def predict_dataloader(self) -> DataLoader[Example]:
        """Cases with the priors that are stored with them."""
        rank, ranks = self._ranks()
        data = _there(self._held)
        return self._loader(data, [Look(index, None) for index in range(len(data))][rank::ranks])

    def held_out(self) -> DataLoader[Example]:
        """All of the validation's looks, whatever process this is: what calibration is done on."""
        return self._loader(_there(self._held), self.fixed_looks())

    def transfer_batch_to_device(self, batch: Batch, device: torch.device, dataloader_idx: int) -> Batch:
        """Only what the network reads goes there."""
        return batch.to(device)

    def typical(self) -> list[Sample]:
        """Some of the training's samples, the same in every process."""
        data = _there(self._train)
        looks = list(Draws(len(data), self._opinions, self.seed))[:TYPICAL]
        return [data[look].sample for look in looks]

    def origin(self) -> dict[str, int | str | None]:
        """Where the training's cases come from, for the card of what was trained."""
        index, known = describe(self.folder), self._known()
        names = {entry.object_name for entry in known}
        every = {entry.object_name for entry in index.cases}
        apart = sorted(every - names)
        return {
            "folder": self.folder.name,
            "seed": index.seed,
            "version": index.version,
            "cases": len(known),
            "objects": len({object_group(name) for name in names}),
            "index": hashlib.sha256((self.folder / INDEX).read_bytes()).hexdigest(),
            **({LEFT_OUT: names_text(apart)} if apart else {}),
            **({} if _first_of(index.seed, every) else {KNOWN: names_text(names)}),
        }

    def fixed_looks(self) -> list[Look]:
        """Every held-out case under every opinion; any share of them from the first on has all opinions."""
        names: tuple[Opinion, ...] = ("right", "uniform", "wrong")
        count = len(_there(self._held))
        order = np.random.default_rng(self.seed).permutation(count)
        return [
            Look(int(case), names[(place + turn) % len(names)], (self.seed, int(case), turn))
            for turn in range(len(names))
            for place, case in enumerate(order)
        ]

    def _read_by(self, stage: str) -> Path:
        """The one folder that a stage reads."""
        return (self.test_folder or self.folder) if stage in ("test", "predict") else self.folder

    def _known(self) -> list[IndexEntry]:
        """Cases of the folder that training and validation may look at."""
        entries = describe(self.folder).cases
        apart = set(left_out(entries, self._folds, self._fold, self.seed))
        return [entry for entry in entries if entry.object_name not in apart]

    def _read(self, paths: Sequence[Path]) -> CaseDataset:
        return CaseDataset(paths, self.encoder, self._opinions)

    def _loader(self, data: CaseDataset, looks: Sampler[Look] | Sequence[Look]) -> DataLoader[Example]:
        return DataLoader(data, batch_size=self._batch_size, sampler=looks, collate_fn=_collate)

    def _ranks(self) -> tuple[int, int]:
        """Which process of how many this is."""
        return (0, 1) if self.trainer is None else (self.trainer.global_rank, self.trainer.world_size)


def _there(data: CaseDataset | None) -> CaseDataset:
    assert data is not None, "the loop calls setup() first"
    return data


def _first_of(seed: int | None, names: set[str]) -> bool:
    """Whether these are the objects of a world from number 0 on, without a gap."""
    made = [GeneratedName.read(name) for name in names]
    numbers = {one.number for one in made if one is not None and one.seed == seed}
    return numbers == set(range(len(names)))


def _collate(examples: list[Example]) -> Batch:
    return make_batch(examples)
