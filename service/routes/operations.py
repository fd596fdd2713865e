"""For those who run the service: is it alive, is it ready, how does it do."""

from fastapi import APIRouter
from fastapi.responses import JSONResponse, Response
from prometheus_client import CONTENT_TYPE_LATEST
from redis.exceptions import RedisError

from service.errors import RETRY_SECONDS, ProblemError
from service.metrics import JobCollector
from service.openapi import public_problems
from service.routes.jobs import FrontNow
from worker.counters import Counters

router = APIRouter(tags=["operations"])


@router.get("/livez", summary="The process answers", responses=public_problems())
async def livez() -> dict[str, str]:
    """Asks nobody: a front whose Redis is away needs no restart."""
    return {"status": "ok"}


@router.get("/readyz", summary="Jobs can be taken and done", responses=public_problems(503))
def readyz(front: FrontNow) -> JSONResponse:
    """Whether Redis and the store take writes, the disk has room, and a worker lives."""
    checks = dict(front.readiness.check())
    if set(checks.values()) != {"ok"}:
        broken = ", ".join(f"{name} {found}" for name, found in checks.items() if found != "ok")
        raise ProblemError("unavailable", broken, retry_after=RETRY_SECONDS, checks=checks)
    return JSONResponse({"status": "ok", "checks": checks})


@router.get(
    "/metrics",
    summary="Prometheus metrics",
    response_class=Response,
    responses=public_problems() | {200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
)
def metrics(front: FrontNow) -> Response:
    """The requests of this front always; the jobs of all when Redis is there."""
    text = front.metrics.text()
    try:
        text += JobCollector(front.queues, front.records, Counters(front.redis)).text()
        redis_up = 1
    except RedisError:
        redis_up = 0
    text += f"# TYPE matphys_redis_up gauge\nmatphys_redis_up {redis_up}\n".encode()
    return Response(text, media_type=CONTENT_TYPE_LATEST)
