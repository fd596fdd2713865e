"""What the page offers to start: a form per kind of job, made from the kind's own request record."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from pydantic import BaseModel

from service.pages.forms import FormField, form_fields

ACCEPTED: Mapping[str, str] = {
    "video": "video/*,.mp4,.mov,.mkv,.webm,.avi",
    "mask": "image/png",
    "camera": "application/json,.json",
    "mesh": ".glb,.obj,.ply",
    "depth": "image/png,.npy",
    "controllers": ".npz",
    "observation": ".npz",
    "transfer": ".npz",
}
"""Which files the browser proposes for an input; others are proposed all. The service checks what it gets."""
FIRST_FIELDS = ("size_m", "shape", "parts", "box", "keyframe")
"""What a user knows of a clip, before which method does what."""
LEFT_OUT = ("webhook",)
"""For programs; a person watches the page."""


@dataclass(frozen=True)
class FileInput:
    """One file that a form sends."""

    name: str
    label: str
    accept: str
    required: bool
    help: str = ""


@dataclass(frozen=True)
class Offer:
    """A form that starts a job."""

    name: str
    collection: str
    """Where its jobs are, below the root or below a twin: `twins`, `diagnoses`."""
    title: str
    help: str
    main: str
    """The input without which there is no job."""
    accept: str
    first: tuple[FormField, ...]
    more: tuple[FormField, ...]
    files: tuple[FileInput, ...]


@dataclass(frozen=True)
class Format:
    """A format that a twin is exported to."""

    name: str
    label: str
    help: str


def make_offer(
    name: str,
    collection: str,
    request: type[BaseModel],
    inputs: Iterable[str] | Mapping[str, str],
    *,
    required: Iterable[str] = (),
    title: str = "",
    help: str = "",
) -> Offer:
    """The form of a kind of job.

    Args:
        name: Of the kind.
        collection: Where its jobs are.
        request: The record that checks its options.
        inputs: Names of the files it takes, and if given what the page says of each.
        required: Those of them it cannot do without; the first is the main one.
        title: What the page calls it.
        help: One sentence for who wonders what it does.
    """
    needed = tuple(required)
    said = inputs if isinstance(inputs, Mapping) else {}
    fields = form_fields(request, LEFT_OUT)
    order = {name: place for place, name in enumerate(FIRST_FIELDS)}
    first = sorted((field for field in fields if field.name in order), key=lambda field: order[field.name])
    main = next(iter(needed), "")
    return Offer(
        name=name,
        collection=collection,
        title=title or name.capitalize(),
        help=help,
        main=main,
        accept=ACCEPTED.get(main, ""),
        first=tuple(first),
        more=tuple(field for field in fields if field.name not in order),
        files=tuple(
            FileInput(each, each.capitalize(), ACCEPTED.get(each, ""), each in needed, said.get(each, ""))
            for each in inputs
        ),
    )
