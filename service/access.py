"""Who may do what: the dependency that every route but the public ones has."""

from collections.abc import Callable
from typing import Annotated

from fastapi import Depends, Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from service.auth import ApiKey, Scope
from service.errors import ProblemError
from service.front import Front, front_of

bearer = HTTPBearer(
    auto_error=False,
    scheme_name="API key",
    description="`Authorization: Bearer KEY`. `matphys-serve` prints a key on its first start; "
    "`matphys-serve keys create` makes more.",
)


def allowed(scope: Scope) -> Callable[..., ApiKey]:
    """A dependency that gives the key of a request, when it has `scope`.

    It runs before a byte of the body is read.
    """

    def authenticate(
        request: Request,
        front: Annotated[Front, Depends(front_of)],
        credentials: Annotated[HTTPAuthorizationCredentials | None, Security(bearer)],
    ) -> ApiKey:
        key = front.keys.check(credentials.credentials) if credentials else None
        if key is None:
            # A good key is heard whatever others send from the same address: behind a proxy all share one,
            # and nobody guesses 256 bits at any rate.
            front.limits.count("refusal", request.client.host if request.client else "unknown")
            detail = "this API key is not known" if credentials else "send Authorization: Bearer KEY"
            raise ProblemError("unauthorized", detail, headers={"WWW-Authenticate": "Bearer"})
        request.scope["state"] |= {"key": key.id, "tenant": key.tenant}
        front.limits.count("request", key.id)
        if not key.allows(scope):
            challenge = f'Bearer error="insufficient_scope", scope="{scope}"'
            raise ProblemError(
                "forbidden", f"this needs the scope {scope}", headers={"WWW-Authenticate": challenge}
            )
        return key

    return authenticate


Reader = Annotated[ApiKey, Depends(allowed("read"))]
Submitter = Annotated[ApiKey, Depends(allowed("submit"))]
