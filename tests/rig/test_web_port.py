"""The port of the workbench: the address lasts over a restart, also where another program has the usual port."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from rig.errors import RigError
from rig.files import home
from rig.web import server

HOST = "127.0.0.1"


@pytest.fixture(autouse=True)
def usual_port(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The usual port, which another program has."""
    home().mkdir(parents=True, exist_ok=True)
    with socket.socket() as other:
        other.bind((HOST, 0))
        other.listen()
        monkeypatch.setattr(server, "PORT", other.getsockname()[1])
        yield server.PORT


def listened(port: int | None = None) -> tuple[int, tuple[int, ...]]:
    listener, taken = server._listen(HOST, port)
    with listener:
        return int(listener.getsockname()[1]), taken


def test_the_next_start_takes_the_same_port_again(usual_port: int) -> None:
    first, taken = listened()
    assert first != usual_port
    assert taken == (usual_port,)
    assert listened() == (first, ())
    with socket.socket() as other:
        other.bind((HOST, first))
        other.listen()
        third, taken = listened()
    assert third not in (first, usual_port)
    assert taken == (first, usual_port)


def test_a_port_that_a_person_names_is_not_kept_and_is_refused_where_it_is_taken(usual_port: int) -> None:
    with pytest.raises(RigError, match=f"cannot listen at {HOST}:{usual_port}"):
        listened(usual_port)
    assert not (home() / server.PORT_FILE).exists()


def test_a_damaged_file_of_the_port_is_ignored() -> None:
    (home() / server.PORT_FILE).write_text("a port")
    assert listened()[0] > 0
