"""The app: routes, errors, what happens around every request."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI

from model.version import __version__
from service import errors, openapi
from service.front import Front
from service.metrics import Metrics
from service.middleware import RequestFrame
from service.routes import operations, twins
from service.settings import Settings


def create_app(settings: Settings) -> FastAPI:
    """The service over one Redis and one store; nothing is asked of either before it starts."""
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
    app.include_router(operations.router)
    errors.install(app)
    app.add_middleware(RequestFrame, metrics=metrics)
    app.openapi = lambda: openapi.describe(app)  # type: ignore[method-assign]
    return app
