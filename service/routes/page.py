"""The page at `/`, made from what the API offers."""

from collections.abc import Iterable

from fastapi import APIRouter

from service.openapi import required_inputs
from service.pages.offers import Format, Offer, make_offer
from service.pages.routes import page_router
from service.resources import Resource
from service.routes.twins import TWINS
from service.settings import Settings
from worker.kinds.export import FORMATS


def page_routes(settings: Settings, children: Iterable[Resource] = ()) -> APIRouter:
    """The page and its files.

    Args:
        settings: Say how large an upload may be.
        children: What can be started on a twin that is done.
    """
    formats = tuple(Format(name, name.upper(), file) for name, file in FORMATS.items())
    return page_router(
        _offer(TWINS), tuple(_offer(child) for child in children), formats, f"{settings.max_upload_mib} MiB"
    )


def _offer(resource: Resource) -> Offer:
    kind = resource.kind
    return make_offer(
        kind.name,
        resource.path.strip("/"),
        kind.options,
        {name: each.help for name, each in kind.inputs.items()},
        required=required_inputs(kind),
        title=resource.title,
        help=resource.help,
    )
