"""What a multimodal model is asked about a part, and what its answer means."""

import json
import math
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError, field_validator, model_validator

from model.errors import InputError
from model.priors.materials import MATERIALS, normalised
from model.priors.table import SPECIFIC_STIFFNESS_CEILING
from model.types import Estimate, MaterialPrior, PartView
from model.units import PROPERTY_UNITS

INTERVAL_WIDTH = 2 * 1.645
"""A range is read as the middle 90 % of a normal distribution of the logarithm."""
MIN_SPREAD = 0.1
"""Nobody knows a material from a picture to better than 10 %."""
LIMITS = {
    "stiffness": (1e2, 1e7),
    "damping": (1e-3, 1.0),
    "drag_rate": (1e-3, 20.0),
    "friction": (0.01, 2.0),
    "restitution": (1e-3, 0.95),
    "density": (5.0, 20000.0),
}
"""What a mass-spring twin can use; answers beyond it are drawn to the limit, with a warning."""

QUESTION = """\
The picture shows an object that someone handles. {what} Judge what it is made of and how it behaves.

Answer with:
- materials: a probability for each of {materials}; they sum to 1. Be honest about doubt.
- shape_class of the whole object: sheet (cloth, paper), rope (cord, cable) or solid (toy, cushion, block).
- a likely range (low, high; nine times out of ten the truth lies within) for each of:
  stiffness: effective Young's modulus in Pa of the body as a whole, air and stuffing included (stuffed plush
    1e4-5e4, cloth 5e4-3e5, foam and soft rubber 1e5-1e6, rigid things at most 5e6);
  damping: damping ratio of its free oscillation (plush 0.1-0.3, rubber 0.03-0.1);
  drag_rate: decay rate of its velocity in air in 1/s (light cloth 2-5, heavy things 0.1-1);
  friction: Coulomb coefficient against a table (rubber 0.6-1, cloth 0.4-0.7, smooth plastic 0.2-0.4);
  restitution: of its bounce on a table (cloth 0.05-0.15, rubber 0.4-0.6);
  density: effective, in kg/m^3 (stuffed toys 60-150, woven cloth 300, rope 500, rubber 1100).
"""


class Range(BaseModel):
    """Low and high end of a positive quantity."""

    model_config = ConfigDict(extra="forbid")
    low: float
    high: float

    @model_validator(mode="after")
    def ordered(self) -> "Range":
        """Not negative, finite, low first; low may be 0, as of something that does not bounce."""
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            raise ValueError("low and high must be finite")
        if not (0.0 <= self.low <= self.high and self.high > 0.0):
            raise ValueError("needs 0 <= low <= high and high > 0")
        return self


class Weights(BaseModel):
    """A probability for each material."""

    model_config = ConfigDict(extra="forbid")
    fabric: float
    leather: float
    rubber: float
    plastic: float
    metal: float
    wood: float
    paper: float
    silk: float
    denim: float
    fur: float

    @field_validator("*")
    @classmethod
    def not_negative(cls, value: float) -> float:
        """Finite and not negative."""
        if not math.isfinite(value) or value < 0.0:
            raise ValueError("must be finite and not negative")
        return value


class Answer(BaseModel):
    """The JSON object that a model must answer with."""

    model_config = ConfigDict(extra="forbid")
    materials: Weights
    shape_class: Literal["sheet", "rope", "solid"]
    stiffness: Range
    damping: Range
    drag_rate: Range
    friction: Range
    restitution: Range
    density: Range


def question(part: PartView) -> str:
    """What to ask about one part, or about the whole object."""
    what = "The object is" if part.label == "object" else "One part of it is"
    what += " outlined and tinted orange; its surroundings are dimmed."
    if part.shape_class is not None:
        what += f" The whole object is known to be of the shape class {part.shape_class}."
    return QUESTION.format(what=what, materials=", ".join(MATERIALS))


def schema() -> dict[str, Any]:
    """JSON schema of `Answer`."""
    return Answer.model_json_schema()


def parse(content: str) -> Answer:
    """The validated answer in the text of a reply; a fenced code block around it is tolerated.

    Raises:
        InputError: the text is not JSON, or does not fit the schema; the message says where.
    """
    text = content.strip()
    if text.startswith("```"):
        text = text.partition("\n")[2].rpartition("```")[0]
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        start = " ".join(content.split())[:60]
        raise InputError(f"the answer is not JSON (it starts with {start!r})") from None
    try:
        answer = Answer.model_validate(value)
        normalised(answer.materials.model_dump())
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(each) for each in first["loc"]) or "the top level"
        raise InputError(f"the answer does not fit the schema at {where}: {first['msg']}") from None
    return answer


def believe(answer: Answer) -> MaterialPrior:
    """A prior with the answer's distribution and a log-normal for each range."""
    warnings: list[str] = []
    ranges: dict[str, Range] = {name: getattr(answer, name) for name in PROPERTY_UNITS}
    properties = {name: _estimate(name, each, LIMITS[name], warnings) for name, each in ranges.items()}
    ceiling = SPECIFIC_STIFFNESS_CEILING * properties["density"].mean
    if properties["stiffness"].mean > ceiling:
        highest = (LIMITS["stiffness"][0], max(ceiling, LIMITS["stiffness"][0]))
        properties["stiffness"] = _estimate("stiffness", ranges["stiffness"], highest, warnings)
    return MaterialPrior(
        distribution=normalised(answer.materials.model_dump()),
        properties=properties,
        shape_class=answer.shape_class,
        warnings=tuple(warnings),
    )


def _estimate(name: str, given: Range, limits: tuple[float, float], warnings: list[str]) -> Estimate:
    """The log-normal whose middle 90 % are the range."""
    low = given.low or min(limits[0], given.high)  # nothing has a logarithm of its own
    mean = math.sqrt(low) * math.sqrt(given.high)
    spread = max((math.log(given.high) - math.log(low)) / INTERVAL_WIDTH, MIN_SPREAD)
    limited = min(max(mean, limits[0]), limits[1])
    if limited != mean:
        warnings.append(
            f"{name} {mean:.3g} {PROPERTY_UNITS[name]} was drawn to {limited:.3g}, which a twin can use"
        )
    return Estimate(mean=limited, spread=spread, unit=PROPERTY_UNITS[name])
