"""The app: routes, errors, what happens around every request."""

from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import asynccontextmanager

from fastapi import APIRouter, FastAPI
from fastapi.routing import APIRoute
from fastapi.sse import EventSourceResponse

from model.version import __version__
from service import errors, openapi
from service.front import Front
from service.metrics import Metrics
from service.middleware import RequestFrame
from service.resources import Resource
from service.routes import operations, twins, webhooks
from service.routes.diagnoses import DIAGNOSES
from service.routes.jobs import job_routes
from service.routes.page import page_routes
from service.settings import Settings

ALL_CHILDREN: tuple[Resource, ...] = (DIAGNOSES,)
"""Kinds of jobs that work on a twin, below `/twins/{id}`; a further one is a `Resource` here."""


def create_app(settings: Settings, children: Sequence[Resource] = ALL_CHILDREN) -> FastAPI:
    """The service over one Redis and one store; nothing is asked of either before it starts.

    Args:
        settings: Where Redis and the store are, and what may be asked of them.
        children: Kinds of jobs that work on a twin.
    """
    metrics = Metrics()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        front = Front.open(settings, metrics)
        front.intake.sweep()
        app.state.front = front
        yield
        await front.close()

    app = FastAPI(
        title="MatPhys",
        version=__version__,
        lifespan=lifespan,
        docs_url=None,  # its scripts come from elsewhere
        redoc_url=None,
        redirect_slashes=False,
        separate_input_output_schemas=False,
    )
    routers = (
        twins.router,
        *map(job_routes, children),
        page_routes(settings, children),
        webhooks.router,
        operations.router,
    )
    for router in (*routers, _heads(routers)):
        app.include_router(router)
    errors.install(app)
    app.add_middleware(RequestFrame, metrics=metrics)
    app.openapi = lambda: openapi.describe(app)  # type: ignore[method-assign]
    return app


def _heads(routers: Iterable[APIRouter]) -> APIRouter:
    """HEAD wherever the routers have GET (RFC 9110, section 9.1); the server sends no body then.

    Not for streams of events, which would be followed to their end for nobody.
    """
    heads = APIRouter(include_in_schema=False)
    for route in (route for router in routers for route in router.routes):
        if isinstance(route, APIRoute) and route.methods == {"GET"}:
            if route.response_class is not EventSourceResponse:
                heads.add_api_route(
                    route.path, route.endpoint, methods=["HEAD"], response_class=route.response_class
                )
    return heads
