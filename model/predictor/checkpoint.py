"""A trained predictor as a file: weights, what they were made with, and a card that says so in words."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from model.encoders.motion import EncoderIdentity
from model.errors import InputError
from model.formats.files import replacing
from model.predictor.checks import finite
from model.predictor.network import PredictorNetwork
from model.predictor.options import NetworkOptions
from model.scenes.generated_name import GeneratedName
from model.scenes.object_group import object_group
from model.version import __version__

SCHEMA = "matphys.predictor/1"
KEY = "matphys"
"""The one entry of the file's metadata: JSON."""
LEFT_OUT = "left out"
"""Entry of `About.data`: `names_text` of the objects of the folder that training never looked at."""
KNOWN = "known"
"""Entry of `About.data`: `names_text` of the objects that training looked at, where they do not follow from
the seed and how many there are."""
LARGEST = 200_000_000
"""Bytes; ours have a few million."""


class About(BaseModel):
    """What a predictor was made with."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_: str = Field(SCHEMA, alias="schema", pattern=f"^{SCHEMA}$")
    version: str = __version__
    options: dict[str, bool | int | float]
    """`NetworkOptions`."""
    motion_dim: int = Field(ge=1, le=10_000)
    motion_global_dim: int = Field(ge=1, le=10_000)
    encoder: str
    """Name of the motion encoder."""
    encoder_version: str
    encoder_weights: str | None = None
    """sha256 of the encoder's own weights."""
    data: dict[str, int | str | None] = {}
    """`folder`, `seed` of the generated cases, numbers of `cases` and `objects`, sha256 of the `index`, who
    was `left out`, if anybody, and who is `known`, where that is not the first objects of the seed."""
    training: dict[str, int | float | str] = {}
    """`epochs`, `seed`, …"""
    validation: dict[str, float] = {}
    """Figures on held-out objects, before calibration."""
    calibration: dict[str, float] = {}
    """What spreads were multiplied by, which the weights contain."""
    config: str = ""
    """The configuration file of the training."""


def names_text(names: Iterable[str]) -> str:
    """Names of objects, which may have spaces, as one entry of `About.data`."""
    return json.dumps(sorted(names), ensure_ascii=False)


def _names(entry: object) -> frozenset[str]:
    """What `names_text` wrote; versions before this one wrote names without spaces, by spaces."""
    text = str(entry or "")
    return frozenset(json.loads(text) if text.startswith("[") else text.split())


@dataclass(frozen=True)
class Trained:
    """A predictor that was trained: what `load_predictor` reads."""

    network: PredictorNetwork
    """In evaluation mode."""
    about: About
    sha256: str
    """Of the file."""

    @property
    def left_out(self) -> frozenset[str]:
        """Names of the objects of its folder that training never looked at."""
        return _names(self.about.data.get(LEFT_OUT))

    def leaves_out(self, object_name: str) -> bool:
        """Whether the object, under this name or that of another recording of it, was left out."""
        return object_group(object_name) in map(object_group, self.left_out)

    def knows(self, object_name: str, index: str) -> bool:
        """Whether training looked at an object; in doubt, it did.

        Generated objects are told by their names wherever they lie: a part of the folder, or one that was
        generated again, has another index and the same objects.

        Args:
            object_name: As the index of its folder has it.
            index: sha256 of that index.
        """
        data = self.about.data
        if self.leaves_out(object_name):
            return False
        if data.get("index") == index:
            return True
        if data.get(KNOWN):
            return object_group(object_name) in map(object_group, _names(data[KNOWN]))
        made, count = GeneratedName.read(object_name), int(data.get("objects") or 0) + len(self.left_out)
        return made is not None and made.seed == data.get("seed") and made.number < count

    @property
    def encoder(self) -> EncoderIdentity:
        """The motion encoder that it was trained with."""
        about = self.about
        return EncoderIdentity(about.encoder, about.encoder_version, about.encoder_weights)

    @property
    def options(self) -> NetworkOptions:
        """Of the network."""
        return NetworkOptions.from_dict(self.about.options)

    @property
    def widths(self) -> tuple[int, int]:
        """Motion features per mass point, per clip."""
        return self.about.motion_dim, self.about.motion_global_dim


def save_predictor(path: Path, network: PredictorNetwork, about: About) -> None:
    """Write weights and `about` to `path`, and the model card beside it (`.md`).

    Equal weights and words give equal bytes.

    Raises:
        InputError: nothing can be written there.
    """
    tensors = {name: value.detach().cpu().contiguous() for name, value in network.state_dict().items()}
    text = json.dumps(about.model_dump(by_alias=True), sort_keys=True, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_bytes(save(tensors, metadata={KEY: text}))
    with replacing(path.with_suffix(".md")) as temporary:
        temporary.write_text(model_card(about, sum(value.numel() for value in tensors.values())))


def load_predictor(path: Path) -> Trained:
    """Read what `save_predictor` wrote.

    Raises:
        InputError: there is no such file, or it is not a predictor of this version.
    """
    try:
        data = path.read_bytes()
        if len(data) > LARGEST:
            raise InputError(f"{path}: {len(data)} bytes: a predictor has at most {LARGEST}")
        with safe_open(str(path), framework="pt") as file:
            text = (file.metadata() or {}).get(KEY, "")
            tensors = {name: file.get_tensor(name) for name in file.keys()}
    except OSError as error:
        raise InputError(f"{path}: {(error.strerror or str(error)).lower()}: expected a predictor") from None
    except SafetensorError as error:
        raise InputError(f"{path}: not a safetensors file: {error}") from None
    try:
        about = About.model_validate_json(text)
    except ValidationError as error:
        raise InputError(f"{path}: not a predictor: {error.errors()[0]['msg']}") from None
    network = NetworkOptions.from_dict(about.options).build(about.motion_dim, about.motion_global_dim)
    try:
        network.load_state_dict(tensors)
    except RuntimeError:
        raise InputError(f"{path}: its weights are not those of its options: another version?") from None
    lost = [name for name, value in tensors.items() if not finite(value)]
    if lost:
        raise InputError(f"{path}: weights that are NaN or infinite, in {lost[0]}: its training diverged")
    return Trained(network.eval(), about, hashlib.sha256(data).hexdigest())


def model_card(about: About, weights: int) -> str:
    """In words what a predictor is, what it was made from, how good it was, and what it is not for."""
    data, training = about.data, about.training
    return "\n".join(
        [
            "# Predictor of mechanics",
            "",
            "From one look at how a soft object moved, from what its parts may be made of and from the shape",
            "of its twin, it predicts the stiffness of every spring and of the grip, and dashpot, drag,",
            f"friction and restitution, each with a spread. {weights} numbers, MatPhys {about.version}.",
            "",
            "## Made from",
            "",
            *_list({"motion encoder": f"{about.encoder} {about.encoder_version}", **data}),
            "",
            _origin(data),
            "",
            "## Training",
            "",
            *_list(training),
            "",
            "## On held-out objects of the same world, before calibration",
            "",
            *_list({name: f"{value:.4g}" for name, value in sorted(about.validation.items())}),
            "",
            "What the figures are: `HeldOut.figures` in `model/predictor/held_out.py`.",
            "",
            "## Calibration",
            "",
            *_calibrated(about.calibration),
            "",
            "## Not for",
            "",
            "Objects that slip, tear, flow or stiffen with strain; motions that neither stretch, bend",
            "nor swing anything, which leave the prior as it is; safety of any kind.",
            "",
            "## Configuration",
            "",
            "```yaml",
            about.config.strip(),
            "```",
            "",
        ]
    )


def _origin(data: Mapping[str, object]) -> str:
    """What kind of objects it learned from; those of a folder without a seed were not generated."""
    if data.get("seed") is None:
        return (
            "Cases that were not generated: what their parts really are was not known, and was learned from"
            " their motion and from what the prior says."
        )
    return (
        "Generated objects alone, of ten materials whose properties were drawn from"
        " `model/priors/table.py`: no recording of a real one."
    )


def _calibrated(factors: Mapping[str, float]) -> list[str]:
    if not factors.get("looks"):
        return ["None: no truth of a held-out object is known, spreads are as they were learned."]
    return [
        "Predicted spreads were multiplied so that 90 % intervals held 90 % of these objects' truths:",
        "",
        *_list({name: f"{value:.3g}" for name, value in factors.items()}),
    ]


def _list(entries: Mapping[str, object]) -> list[str]:
    return [f"- {name.replace('_', ' ')}: {value}" for name, value in entries.items()] or ["- not recorded"]
