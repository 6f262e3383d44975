"""The token of the workbench: kept for the user, so that a bookmark and open pages last over a restart."""

from __future__ import annotations

import os
import re
import secrets
from contextlib import suppress
from pathlib import Path

from rig.files import home

NAME = "web-token"
BYTES = 24
FORM = re.compile(r"[\w-]{32}")  # of a token of so many bytes
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
