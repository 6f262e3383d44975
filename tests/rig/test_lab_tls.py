"""The wire to the lab's record: encrypted to the right server, or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from rig.lab_url import lab_url
from rig.record.lab import options
from tests.rig.conftest import WORD, Rig
from tests.rig.cutting import Judge, wire
from tests.rig.postgres import Server
from tests.rig.tls import Certificate, certificate, encrypting

HOST = "lab.example"
AT = f"{HOST}:{{port}}/{{database}}?hostaddr=127.0.0.1"  # a name of another machine, and where it really is


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> Certificate:
    return certificate(tmp_path_factory.mktemp("right"), HOST)


@pytest.fixture
def port(people: Server, right: Certificate, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Of the server with TLS, that lets in people with a password."""
    monkeypatch.setenv("PGPASSWORD", WORD)
    with encrypting(people.port, right) as front:
        yield front


def test_the_right_server_is_read_and_nothing_of_it_in_plain_text(
    rig: Rig, port: int, database: str, right: Certificate
) -> None:
    seen: list[bytes] = []
    with wire(port, lambda: lambda piece, _: seen.append(piece)) as tapped:
        url = f"postgresql://anna@{AT.format(port=tapped.port, database=database)}"
        ended = rig("runs", "--json", "--record", f"{url}&sslmode=verify-full&sslrootcert={right.path}")
    assert (ended.status, ended.err) == (0, "")
    assert len(b"".join(seen)) > 2000
    assert not [word for word in (b"anna", b"SELECT", b"runs", database.encode()) if word in b"".join(seen)]


def test_a_server_of_another_root_or_name_is_refused(
    rig: Rig, port: int, database: str, right: Certificate, tmp_path: Path
) -> None:
    wrong = certificate(tmp_path, HOST)
    at = AT.format(port=port, database=database)
    for url, why in (
        (f"{at}&sslmode=verify-full&sslrootcert={wrong.path}", "certificate verify failed"),
        (f"{at}&sslmode=verify-full&sslrootcert={tmp_path / 'none.crt'}", "none.crt"),
        (f"{at.replace(HOST, 'other.example')}&sslmode=verify-full&sslrootcert={right.path}", "does not match host"),
    ):
        ended = rig("runs", "--record", f"postgresql://anna@{url}")
        assert (ended.status, ended.out) == (2, "")
        assert len(ended.err.splitlines()) == 1
        assert why in ended.err
        assert "there is no encrypted connection to a trusted server" in ended.err
        assert "Give the certificate of the server's signer in sslrootcert" in ended.err


def test_a_connection_to_another_machine_is_encrypted_unless_the_user_sets_another_mode(
    rig: Rig, server: Server, database: str
) -> None:
    asked: list[bytes] = []

    def listening() -> Judge:
        return lambda piece, from_server: None if from_server else asked.append(piece)

    with wire(server.port, listening) as tapped:
        url = f"postgresql://postgres@{AT.format(port=tapped.port, database=database)}"
        ended = rig("runs", "--record", url)
        assert (ended.status, asked) == (2, [bytes.fromhex("00000008 04d2162f")])
        assert "server does not support SSL, but SSL was required" in ended.err
        assert "set `ssl = on` in the server's postgresql.conf" in ended.err
        assert rig("runs", "--record", f"{url}&sslmode=disable").status == 0


def test_addresses_of_this_machine_need_no_encryption(monkeypatch: pytest.MonkeyPatch) -> None:
    def mode(url: str) -> str | None:
        return options(lab_url(url)).get("sslmode")

    here = ("127.0.0.1", "localhost", "[::1]", "")
    assert {mode(f"postgresql://rig7@{host}/rigs") for host in here} == {None}
    assert mode("postgresql://rig7@/rigs?host=/run/postgresql") is None
    for url in ("postgresql://rig7@lab.example/rigs", "postgresql://rig7@/rigs?host=localhost&host=lab.example"):
        assert mode(url) == "require"
        assert mode(f"{url}{'&' if '?' in url else '?'}sslmode=prefer") is None
    monkeypatch.setenv("PGHOST", "lab.example")
    assert mode("postgresql://rig7@/rigs") == "require"
    monkeypatch.setenv("PGSSLMODE", "disable")
    assert mode("postgresql://rig7@lab.example/rigs") is None
