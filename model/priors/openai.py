"""A multimodal model behind an OpenAI-compatible endpoint as material expert."""

import base64
import hashlib
import json
import os
import time
from collections.abc import Callable
from dataclasses import replace
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any, ClassVar

import httpx
from jaxtyping import Bool

from model.errors import InputError
from model.formats.files import replacing
from model.priors.answer import Answer, believe, parse, question, schema
from model.priors.overlay import overlay_png
from model.types import Array, MaterialPrior, PartView

BASE_URL_VARIABLE = "MATPHYS_OPENAI_BASE_URL"
MODEL_VARIABLE = "MATPHYS_OPENAI_MODEL"
KEY_VARIABLE = "OPENAI_API_KEY"
MAX_REPLY_BYTES = 4 * 1024 * 1024
MAX_WAIT_S = 60.0
"""A server that asks to wait longer than this is not waited for."""
TRANSIENT = (httpx.TimeoutException, httpx.ReadError, httpx.WriteError, httpx.RemoteProtocolError)


class OpenAIPrior:
    """Asks any OpenAI-compatible chat-completions endpoint (vLLM, Ollama, hosted) about a highlighted part.

    Answers that fit are kept on disk under the hash of the request, so that the same question is asked once.
    """

    name: ClassVar[str] = "openai"
    version: ClassVar[str] = "1"
    weights: str | None

    def __init__(
        self,
        base_url: str | None = None,
        model: str | None = None,
        api_key: str | None = None,
        cache: Path | None = None,
        timeout_s: float = 60.0,
        attempts: int = 4,
        backoff_s: float = 1.0,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Nothing is sent yet.

        Args:
            base_url: Such as `http://localhost:8000/v1`; else from MATPHYS_OPENAI_BASE_URL.
            model: Name of the model there; else from MATPHYS_OPENAI_MODEL.
            api_key: If the endpoint wants one; else from OPENAI_API_KEY.
            cache: Folder of the answers; `~/.cache/matphys/priors` if left out.
            timeout_s: Longest wait for one answer [s].
            attempts: How often one question is sent at most.
            backoff_s: Wait after the first failure [s]; doubles with each.
            sleep: What waits.

        Raises:
            InputError: no endpoint or no model was named, or one of them cannot be used.
        """
        url = (base_url or os.environ.get(BASE_URL_VARIABLE, "")).strip().rstrip("/")
        chosen = (model or os.environ.get(MODEL_VARIABLE, "")).strip()
        key = (api_key if api_key is not None else os.environ.get(KEY_VARIABLE, "")).strip()
        if not url:
            raise InputError(
                f"openai prior: no endpoint; set {BASE_URL_VARIABLE}, e.g. http://localhost:8000/v1"
            )
        if not chosen:
            raise InputError(f"openai prior: no model; set {MODEL_VARIABLE} to a model of the endpoint")
        if not (key.isascii() and (key.isprintable() or not key)):
            raise InputError(f"openai prior: {KEY_VARIABLE} holds characters no API key has; set it again")
        self.weights = chosen
        self._url = _checked(url)
        self._key = key
        self._cache = cache if cache is not None else Path.home() / ".cache" / "matphys" / "priors"
        self._timeout_s = timeout_s
        self._attempts, self._backoff, self._sleep = max(1, attempts), backoff_s, sleep

    def material(self, part: PartView) -> MaterialPrior:
        """Ask, or take the answer that was given before.

        Of a part without a visible pixel the whole object is asked about, and a warning says so.

        Raises:
            InputError: the endpoint cannot be reached, refuses, or answers something that does not fit.
        """
        if not part.mask.any():
            prior = self.material(replace(part, mask=_object_pixels(part), label="object"))
            hidden = f"{part.label} is not visible on the keyframe: judged by the whole object"
            return replace(prior, warnings=(*prior.warnings, hidden))
        body = self._body(part)
        request = hashlib.sha256(str(self._url).encode() + b"\n" + body).hexdigest()
        known = self._cache / f"{request}.json"
        answer = _remembered(known)
        if answer is None:
            content = self._content(self._ask(body))
            try:
                answer = parse(content)
            except InputError as error:
                raise self._error(f"{error}; use a model that follows JSON schemas") from None
            _remember(known, answer)
        prior = believe(answer)
        return prior if part.shape_class is None else replace(prior, shape_class=part.shape_class)

    def _body(self, part: PartView) -> bytes:
        """The request, the same bytes for the same part."""
        picture = "data:image/png;base64," + base64.b64encode(overlay_png(part)).decode()
        message = [
            {"type": "text", "text": question(part)},
            {"type": "image_url", "image_url": {"url": picture}},
        ]
        wanted = {"name": "material", "strict": True, "schema": schema()}
        request = {
            "model": self.weights,
            "messages": [{"role": "user", "content": message}],
            "response_format": {"type": "json_schema", "json_schema": wanted},
        }
        return json.dumps(request, sort_keys=True).encode()

    def _ask(self, body: bytes) -> bytes:
        """Send until it succeeds, fails for good, or was tried often enough."""
        headers = {"Content-Type": "application/json"}
        if self._key:
            headers["Authorization"] = f"Bearer {self._key}"
        last = ""
        timeout = httpx.Timeout(self._timeout_s, connect=min(self._timeout_s, 10.0))
        with httpx.Client(timeout=timeout, headers=headers) as client:
            for attempt in range(self._attempts):
                wait = self._backoff * 2.0**attempt
                try:
                    status, asked, reply = _post(client, self._url, body, self._timeout_s)
                except TRANSIENT as error:
                    late = isinstance(error, httpx.TimeoutException)
                    last = f"no answer within {self._timeout_s:g} s" if late else "the connection broke"
                except httpx.HTTPError as error:
                    raise self._error(f"cannot be reached ({error})") from None
                else:
                    if status == 200:
                        return reply
                    last = f"answered {status}{_reason(reply)}"
                    if status != 429 and status < 500:
                        raise self._error(last)
                    wait = wait if asked is None else asked
                if wait > MAX_WAIT_S:
                    raise self._error(f"{last} and asks to wait {wait:.0f} s; try again later")
                if attempt + 1 < self._attempts:
                    self._sleep(wait)
        raise self._error(f"{last}, {self._attempts} times; try again later")

    def _content(self, reply: bytes) -> str:
        """The text of the first choice."""
        try:
            content = json.loads(reply)["choices"][0]["message"]["content"]
        except (ValueError, KeyError, IndexError, TypeError, RecursionError):
            raise self._error("answered something that is no chat completion; check the address") from None
        if not isinstance(content, str):
            raise self._error("answered without text (a refusal?); use another model")
        return content

    def _error(self, what: str) -> InputError:
        """One line that names the endpoint but holds no secret."""
        line = " ".join(f"openai prior: {_public(self._url)}: {what}".split())
        return InputError(line.replace(self._key, "[key]") if self._key else line)


def _object_pixels(part: PartView) -> Bool[Array, "H W"]:
    """The object's mask, which must not be empty."""
    if not part.object_mask.any():
        raise InputError("openai prior: the object's mask is empty; there is nothing to ask about")
    return part.object_mask


def _checked(base: str) -> httpx.URL:
    """Address of the chat completions below a base address."""
    try:
        url = httpx.URL(f"{base}/chat/completions")
    except httpx.InvalidURL:
        url = httpx.URL("")
    if url.scheme not in ("http", "https") or not url.host:
        raise InputError(f"openai prior: {BASE_URL_VARIABLE} must be an http or https address")
    return url


def _public(url: httpx.URL) -> str:
    """The address without user name, password and query."""
    return str(url.copy_with(username=None, password=None, query=None, fragment=None))


def _post(
    client: httpx.Client, url: httpx.URL, body: bytes, timeout_s: float
) -> tuple[int, float | None, bytes]:
    """Status, what Retry-After asks for [s], and the body (its first megabytes)."""
    begin = time.monotonic()
    with client.stream("POST", url, content=body) as response:
        reply = bytearray()
        for chunk in response.iter_bytes():
            reply += chunk
            if len(reply) > MAX_REPLY_BYTES:
                break
            if time.monotonic() - begin > timeout_s:  # drip by drip, each in time
                raise httpx.ReadTimeout("the answer takes too long")
        return response.status_code, _retry_after(response.headers.get("Retry-After")), bytes(reply)


def _retry_after(value: str | None) -> float | None:
    """Seconds that a Retry-After header (seconds or a date) asks for."""
    if value is None:
        return None
    try:
        return max(0.0, float(value))
    except ValueError:
        pass
    try:
        return max(0.0, parsedate_to_datetime(value).timestamp() - time.time())
    except ValueError:
        return None


def _reason(reply: bytes) -> str:
    """What an error reply says, shortened; nothing if it says nothing readable."""
    try:
        value: Any = json.loads(reply)
        value = value.get("error", value) if isinstance(value, dict) else value
        said = value.get("message", "") if isinstance(value, dict) else value
    except (ValueError, RecursionError):
        return ""
    text = " ".join(str(said).split())[:200]
    return f" ({text})" if text else ""


def _remembered(path: Path) -> Answer | None:
    """An answer from disk; none if there is none or it is damaged."""
    try:
        return parse(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _remember(path: Path, answer: Answer) -> None:
    """Keep an answer; a disk that takes none costs only a repeated question."""
    try:
        with replacing(path) as temporary:
            temporary.write_text(answer.model_dump_json(), encoding="utf-8")
    except (InputError, OSError):
        return
