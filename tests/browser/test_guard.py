"""Who may speak to the workbench: only who has the token, by its own name, from its own pages."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pytest
from starlette.types import Message, Receive, Scope, Send

from rig.web.guard import Guard, names

SECRET = "the-token"  # noqa: S105
COOKIE = {"cookie": f"rig-8473={SECRET}"}


@dataclass(frozen=True)
class Answer:
    """What came back: an HTTP status or the code of a closed websocket; `let_in` has the query that the app saw."""

    status: int
    headers: Mapping[str, str]
    let_in: str | None


def ask(query: str = "", headers: Mapping[str, str] | None = None, kind: str = "http", path: str = "/") -> Answer:
    """Send one request, or open one websocket, through the guard."""
    given = {"host": "127.0.0.1:8473", **(headers or {})}
    encoded = [(name.encode(), value.encode("latin-1")) for name, value in given.items()]
    scope: dict[str, Any] = {"type": kind, "path": path, "query_string": query.encode(), "headers": encoded}
    seen: list[str] = []
    sent: list[Message] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        seen.append(scope["query_string"].decode())
        start = {"type": "http.response.start", "status": 200, "headers": []}
        await send(start if scope["type"] == "http" else {"type": "websocket.accept"})

    async def receive() -> Message:
        return {"type": "http.request"}

    async def send(message: Message) -> None:
        sent.append(message)

    asyncio.run(Guard(app, SECRET, names("127.0.0.1", 8473))(scope, receive, send))
    told = {name.decode(): value.decode() for name, value in sent[0].get("headers", [])}
    return Answer(sent[0].get("status") or sent[0].get("code", 101), told, seen[0] if seen else None)


def test_the_token_becomes_a_cookie_and_leaves_the_address() -> None:
    answer = ask(f"token={SECRET}&procedure=sweep", path="/run")
    assert (answer.status, answer.headers["location"], answer.let_in) == (303, "/run?procedure=sweep", None)
    assert answer.headers["set-cookie"] == f"rig-8473={SECRET}; HttpOnly; SameSite=Strict; Path=/; Max-Age=34560000"
    assert ask("procedure=sweep", COOKIE).let_in == "procedure=sweep"


@pytest.mark.parametrize(
    ("headers", "query", "status"),
    [
        ({}, "", 401),
        ({}, "token=wrong", 401),
        ({}, "token=", 401),
        ({"cookie": "rig-8473=wrong"}, "", 401),
        ({"cookie": "rig-8474=the-token"}, "", 401),  # that of another workbench on this machine
        ({"cookie": "rig-8473=\xe9"}, "", 401),
        ({"cookie": f'{{odd}}="a b"; rig-8473={SECRET}; =;'}, "", 200),  # another program of this host has odd ones
        (COOKIE | {"host": "rig.attacker.example:8473"}, "", 403),  # DNS rebinding
        (COOKIE | {"origin": "http://attacker.example"}, "", 403),
        (COOKIE | {"origin": "http://127.0.0.1:9999"}, "", 403),
        (COOKIE | {"origin": "null"}, "", 403),
        (COOKIE | {"host": "localhost:8473", "origin": "http://localhost:8473"}, "", 200),
        (COOKIE, "", 200),
        ({"cookie": f"rig-8473={SECRET}; rig-8473=stale"}, "", 200),
        ({"cookie": f"rig-8473=stale; rig-8473={SECRET}"}, "", 200),
        ({"cookie": f'rig-8473="{SECRET}"'}, "", 200),
    ],
)
def test_only_requests_of_the_own_page_are_accepted(headers: Mapping[str, str], query: str, status: int) -> None:
    answer = ask(query, headers)
    assert (answer.status, answer.let_in is not None) == (status, status == 200)


@pytest.mark.parametrize("headers", [{}, COOKIE | {"origin": "http://attacker.example"}, COOKIE | {"host": "x:8473"}])
def test_websockets_are_guarded_as_well(headers: Mapping[str, str]) -> None:
    answer = ask(f"token={SECRET}", headers, "websocket")  # a websocket has the cookie, or nothing
    assert (answer.status, answer.let_in) == (1008, None)


def test_a_websocket_of_our_own_page_is_accepted() -> None:
    assert ask("", COOKIE | {"origin": "http://127.0.0.1:8473"}, "websocket").let_in == ""


@pytest.mark.parametrize("headers", [COOKIE, {}])
def test_a_page_loads_only_our_own_files(headers: Mapping[str, str]) -> None:
    told = ask("", headers).headers
    assert "default-src 'none'" in told["content-security-policy"]
    assert "frame-ancestors 'none'" in told["content-security-policy"]
    assert told["referrer-policy"] == "no-referrer"
    assert told["x-content-type-options"] == "nosniff"


def test_the_host_names_of_another_address_are_only_its_own() -> None:
    assert names("192.168.1.40", 80) == {"192.168.1.40:80"}
