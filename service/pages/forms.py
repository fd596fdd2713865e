"""Form fields made from a request's record: a new option or kind of job appears on the page by itself."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from pydantic import BaseModel

Control: TypeAlias = Literal["number", "text", "choice", "check"]


@dataclass(frozen=True)
class FormField:
    """One input of a form."""

    name: str
    label: str
    control: Control
    help: str = ""
    value: str = ""
    """What the service takes when the field is left alone."""
    required: bool = False
    choices: tuple[str, ...] = ()
    minimum: float | None = None
    maximum: float | None = None
    whole: bool = False
    pattern: str | None = None
    example: str = ""


def form_fields(request: type[BaseModel], leave_out: Iterable[str] = ()) -> tuple[FormField, ...]:
    """The fields of a request, in its order.

    Args:
        request: The record that checks the request.
        leave_out: Names that get no field.
    """
    schema = request.model_json_schema()
    required = set(schema.get("required", ()))
    skipped = set(leave_out)
    return tuple(
        _field(name, facts, name in required)
        for name, facts in schema.get("properties", {}).items()
        if name not in skipped
    )


def _field(name: str, facts: Mapping[str, Any], required: bool) -> FormField:
    kind = _first_real(facts)
    example = next(iter(facts.get("examples", ())), None)
    choices = tuple(str(choice) for choice in kind.get("enum", ()))
    exclusive, whole = kind.get("exclusiveMinimum"), kind.get("type") == "integer"
    # HTML knows no exclusive bound: the one number it lets through too many is refused by the service.
    minimum = kind.get("minimum", exclusive + 1 if whole and exclusive is not None else exclusive)
    return FormField(
        name=name,
        label=name.removesuffix("_m").replace("_", " ").capitalize()
        + (" [m]" if name.endswith("_m") else ""),
        control=_control(kind, choices),
        help=facts.get("description", "").replace("`", ""),
        value="" if facts.get("default") is None else str(facts["default"]),
        required=required,
        choices=choices,
        minimum=minimum,
        maximum=kind.get("maximum", kind.get("exclusiveMaximum")),
        whole=whole,
        pattern=kind.get("pattern"),
        example="" if example is None else str(example),
    )


def _first_real(facts: Mapping[str, Any]) -> Mapping[str, Any]:
    """Of `something or null`, the something."""
    variants: list[Mapping[str, Any]] = facts.get("anyOf", [facts])
    return next((variant for variant in variants if variant.get("type") != "null"), facts)


def _control(kind: Mapping[str, Any], choices: tuple[str, ...]) -> Control:
    if choices:
        return "choice"
    if kind.get("type") == "boolean":
        return "check"
    return "number" if kind.get("type") in ("integer", "number") else "text"
