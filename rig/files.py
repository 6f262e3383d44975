"""Writing results: whole or not at all, and never over what they were made from."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from rig.errors import OutputError


def require_out(out: Path, *inputs: str | Path | None) -> None:
    """A result needs a folder, and takes the place of nothing that it was made from."""
    if not out.parent.is_dir():
        raise OutputError(f"{out}: there is no folder {out.parent}; make it, or name another file")
    for given in inputs:
        if given is not None and Path(given).exists() and out.exists() and out.samefile(given):
            raise OutputError(f"{out}: would overwrite {given}, which this is made from; name another file")


def write_whole(out: Path, content: str | bytes) -> None:
    """Write a file so that it appears whole or not at all. Raises OutputError."""
    beside = out.with_name(f".{out.name}.{os.getpid()}")
    try:
        beside.write_bytes(content.encode() if isinstance(content, str) else content)
        beside.replace(out)
    except OSError as error:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        raise OutputError(f"{out}: cannot be written: {error.strerror}; name another file") from None
