"""Telling somebody else's server that a job has ended: signed, and never to an address inside our network.

Reference:
    Standard Webhooks specification, https://www.standardwebhooks.com.
"""

import base64
import hashlib
import hmac
import ipaddress
import secrets
import socket
import ssl
from collections.abc import Iterable
from datetime import datetime
from typing import Any, Final, cast

import httpcore
from redis import Redis
from standardwebhooks.webhooks import Webhook

CONNECT_S: Final = 5.0
ANSWER_S: Final = 15.0
MOST_ADDRESSES: Final = 2
"""Of one name that are tried: a long list of silent ones must not hold a worker."""
GLOBAL_6: Final = ipaddress.ip_network("2000::/3")
"""All that is routed on the public internet; most of the rest stands for something private or for IPv4."""
REFUSED: Final = tuple(
    map(ipaddress.ip_network, ("2002::/16", "2001::/32", "192.0.0.0/24", "168.63.129.16/32"))
)
"""Behind the first two stands an IPv4 address, which may be a private one; behind the others, services that
clouds offer to their own machines."""


class Undelivered(Exception):
    """The receiver could not be reached or did not answer with 2xx; the message may be shown to the owner."""


def secret_of(redis: "Redis", tenant: str) -> str:
    """What a tenant checks the signatures of its webhooks with: `whsec_...`; the same at every call."""
    redis.set("matphys:webhook-secret", secrets.token_hex(32), nx=True)
    ours = cast(str, redis.get("matphys:webhook-secret"))
    return "whsec_" + base64.b64encode(hmac.digest(ours.encode(), tenant.encode(), hashlib.sha256)).decode()


def deliver(
    url: str, message_id: str, at: datetime, body: bytes, secret: str, *, allow_private: bool = False
) -> None:
    """POST a signed message.

    Args:
        url: Of the receiver.
        message_id: The same for every try, so that the receiver can tell a repetition.
        at: Time of this try, UTC.
        body: JSON.
        secret: As `secret_of` gives it.
        allow_private: Whether the receiver may be inside our network.

    Raises:
        Undelivered: it did not arrive.
    """
    headers: dict[bytes | str, bytes | str] = {
        "Content-Type": "application/json",
        "User-Agent": "matphys",
        "Webhook-Id": message_id,
        "Webhook-Timestamp": str(int(at.timestamp())),
        "Webhook-Signature": Webhook(secret).sign(message_id, at, body.decode()),
    }
    limits = {"connect": CONNECT_S, "read": ANSWER_S, "write": ANSWER_S, "pool": ANSWER_S}
    backend = httpcore.SyncBackend() if allow_private else PublicOnly()
    try:
        with (
            httpcore.ConnectionPool(
                ssl_context=ssl.create_default_context(), network_backend=backend
            ) as pool,
            pool.stream("POST", url, headers=headers, content=body, extensions={"timeout": limits}) as answer,
        ):
            status = answer.status
    except (httpcore.NetworkError, httpcore.TimeoutException, httpcore.ProtocolError, OSError) as error:
        why = f": {error}" if str(error) else ""
        raise Undelivered(f"no answer ({type(error).__name__}{why})") from error
    except (httpcore.UnsupportedProtocol, UnicodeError, ValueError) as error:
        raise Undelivered("not a URL that can be posted to") from error
    if not 200 <= status < 300:
        raise Undelivered(f"the answer was {status}")


class PublicOnly(httpcore.SyncBackend):
    """Connects to public addresses alone; looks at the address that is really connected to."""

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[Any] | None = None,
    ) -> httpcore.NetworkStream:
        """Resolve once, refuse unless all addresses are public, and connect to the first that answers."""
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        except (OSError, UnicodeError) as error:
            raise httpcore.ConnectError("the name is unknown") from error
        addresses = list(dict.fromkeys(str(entry[4][0]) for entry in found))
        if not addresses or not all(map(is_public, addresses)):
            raise httpcore.ConnectError("not a public address")
        problem: Exception = httpcore.ConnectError("no address")
        for address in addresses[:MOST_ADDRESSES]:
            try:
                return super().connect_tcp(address, port, timeout, local_address, socket_options)
            except (httpcore.ConnectError, httpcore.ConnectTimeout) as error:
                problem = error
        raise problem

    def connect_unix_socket(
        self, path: str, timeout: float | None = None, socket_options: Iterable[Any] | None = None
    ) -> httpcore.NetworkStream:
        """Never."""
        raise httpcore.ConnectError("not a public address")


def is_public(address: str) -> bool:
    """Whether an IP address belongs to the public internet."""
    ip = ipaddress.ip_address(address.partition("%")[0])
    mapped = getattr(ip, "ipv4_mapped", None)
    if mapped is not None:
        ip = mapped
    if ip.version == 6 and ip not in GLOBAL_6:
        return False
    return ip.is_global and not ip.is_multicast and not any(ip in network for network in REFUSED)
