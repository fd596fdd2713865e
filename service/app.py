"""The app: routes, errors, what happens around every request."""

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

from fastapi import FastAPI

from model.version import __version__
from service import errors, openapi
from service.front import Front
from service.metrics import Metrics
from service.middleware import RequestFrame
from service.resources import Resource
from service.routes import operations, twins, webhooks
from service.routes.jobs import job_routes
from service.routes.page import page_routes
from service.settings import Settings

ALL_CHILDREN: tuple[Resource, ...] = ()
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
    app.include_router(twins.router)
    for child in children:
        app.include_router(job_routes(child))
    app.include_router(page_routes(settings, children))
    app.include_router(webhooks.router)
    app.include_router(operations.router)
    errors.install(app)
    app.add_middleware(RequestFrame, metrics=metrics)
    app.openapi = lambda: openapi.describe(app)  # type: ignore[method-assign]
    return app
