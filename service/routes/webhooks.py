"""What a receiver of webhooks has to know."""

from fastapi import APIRouter

from model.job_schema import WebhookSecret
from service.access import Submitter
from service.openapi import problems
from service.routes.jobs import FrontNow
from worker.webhooks import secret_of

router = APIRouter(tags=["webhooks"])


@router.get("/webhook-secret", summary="The secret that webhooks are signed with", responses=problems())
def webhook_secret(front: FrontNow, key: Submitter) -> WebhookSecret:
    """Of the key's tenant: a receiver checks the signature with it (Standard Webhooks)."""
    return WebhookSecret(secret=secret_of(front.redis, key.tenant))
