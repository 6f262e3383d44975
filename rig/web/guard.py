"""Access control: requests need the token, the host name of the workbench, and its own pages as origin.

A page of another site can send requests to 127.0.0.1, but it does not know the token, it cannot send the cookie
(SameSite), and its own host name for 127.0.0.1 is refused (DNS rebinding). The same holds for websockets. The pages of
the workbench load nothing from other hosts.
"""

from __future__ import annotations

import hmac
import os
import re
import secrets
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qsl, urlencode

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from rig.files import home

TOKEN = "token"  # noqa: S105 the name of the query's field
LASTS_S = 400 * 86_400  # of the cookie: the longest that browsers keep one
POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self' 'unsafe-inline' 'unsafe-eval'",  # Vue compiles its templates in the page
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "font-src 'self' data:",
        "connect-src 'self'",
        "worker-src 'self' blob:",
        "base-uri 'none'",
        "form-action 'self'",
        "frame-ancestors 'none'",
    )
)
HEADERS = (
    (b"content-security-policy", POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)
UNKNOWN = "This page needs a token. Open the address that `rig web` printed."
ELSEWHERE = "This is not the address of the workbench. Open the address that `rig web` printed."


@dataclass(frozen=True)
class Guard:
    """Serves `app` to requests with `token` and one of `hosts` ("127.0.0.1:8473")."""

    app: ASGIApp
    token: str
    hosts: frozenset[str]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        query = dict(parse_qsl(scope["query_string"].decode("latin-1")))
        if not self._is_ours(headers):
            await _refuse(scope, send, 403, ELSEWHERE)
        elif scope["type"] == "http" and TOKEN in query and self._fits(query.pop(TOKEN)):
            await self._let_in(scope, send, query)
        elif not any(self._fits(token) for token in _cookies(scope, self.cookie)):
            await _refuse(scope, send, 401, UNKNOWN)
        else:
            await self.app(scope, receive, _with_headers(send))

    @property
    def cookie(self) -> str:
        """The name of the cookie, with the port: all ports of a host share their cookies."""
        return f"rig-{min(self.hosts).rpartition(':')[2]}"

    def _is_ours(self, headers: Mapping[str, str]) -> bool:
        """Whether the host is ours, and the origin, if there is one, is the same host."""
        host, origin = headers.get("host", ""), headers.get("origin")
        return host in self.hosts and origin in (None, f"http://{host}")

    def _fits(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self.token.encode())

    async def _let_in(self, scope: Scope, send: Send, query: Mapping[str, str]) -> None:
        """Move the token from the address to a cookie, because addresses are stored and passed on."""
        place = scope["path"] + (f"?{urlencode(query)}" if query else "")
        cookie = f"{self.cookie}={self.token}; HttpOnly; SameSite=Strict; Path=/; Max-Age={LASTS_S}"
        headers = [(b"location", place.encode()), (b"set-cookie", cookie.encode()), (b"content-length", b"0")]
        await send({"type": "http.response.start", "status": 303, "headers": [*headers, *HEADERS]})
        await send({"type": "http.response.body", "body": b""})


def names(host: str, port: int) -> frozenset[str]:
    """The host names of a server at `host` and `port`."""
    host_names: Iterable[str] = ("127.0.0.1", "localhost") if host in ("127.0.0.1", "localhost") else (host,)
    return frozenset(f"{name}:{port}" for name in host_names)


def _cookies(scope: Scope, name: str) -> list[str]:
    """The values of the cookies `name`. All programs of this host share them: no other cookie must hide ours."""
    texts = [value.decode("latin-1") for header, value in scope["headers"] if header == b"cookie"]
    pairs = [cookie.partition("=") for cookie in ";".join(texts).split(";")]
    return [value.strip().strip('"') for found, _, value in pairs if found.strip() == name]


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message["headers"], *HEADERS]}
        await send(message)

    return sending


async def _refuse(scope: Scope, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": reason[:100]})
        return
    if scope["path"] == "/favicon.ico":  # a browser asks for it by itself, and would log a refusal as an error
        status, reason = 204, ""
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"cache-control", b"no-store"), *HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": reason.encode()})


# The token is kept for the user, so that a bookmark and open pages last over a restart.

NAME = "web-token"
BYTES = 24
FORM = re.compile(r"[\w-]{32}")  # of a token
OTHERS = 0o077  # permissions of other users


def kept_token(new: bool = False) -> str:
    """The token of this user; a new one if none is kept, if other users may read it, or if `new` is set.

    Where it cannot be kept, for example on a full disk, it is for this start only.
    """
    path = home() / NAME
    if not new and (stored := _read_token(path)) is not None:
        return stored
    token = secrets.token_urlsafe(BYTES)
    with suppress(OSError):
        _write(path, token)
    return token


def _read_token(path: Path) -> str | None:
    """The token in a file that only its owner can read, else None."""
    try:
        text = path.read_text(encoding="ascii").strip()
        private = os.name != "posix" or not path.stat().st_mode & OTHERS
    except (OSError, ValueError):
        return None
    return text if private and FORM.fullmatch(text) else None


def _write(path: Path, token: str) -> None:
    """Replace the file; no other user can read it at any time. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    draft.unlink(missing_ok=True)
    with os.fdopen(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(token)
    draft.replace(path)
