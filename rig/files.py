"""Output files, the folders of the record and of locks, free disk space, and the version of the program."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rig.errors import OutputError


def require_out(path: Path, *inputs: str | Path | None) -> None:
    """Raises OutputError if the folder of `path` is missing, or if `path` is a device or one of the input files."""
    if not path.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.parent}; make it, or give another file")
    _require_regular(path)
    for file in inputs:
        if file is not None and Path(file).exists() and path.exists() and path.samefile(file):
            raise OutputError(f"{path}: this would overwrite the input file {file}; give another file")


def require_new(*paths: Path) -> None:
    """Raises OutputError for a file that exists."""
    if existing := next((path for path in paths if path.exists()), None):
        raise OutputError(f"{existing}: this file exists; give another file, or replace this one with --force")


def _require_regular(path: Path) -> None:
    if path.exists() and not path.is_file():
        raise OutputError(f"{path}: is not a regular file, so it is not overwritten; give another file")


def make_folder(folder: Path) -> None:
    """Make the folder and those above it. Raises OutputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot make the folder: {error.strerror}; give another folder") from None


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file completely or not at all, and never in the place of a device. Raises OutputError."""
    with draft_of(path) as draft:
        draft.write_bytes(content.encode() if isinstance(content, str) else content)


@contextmanager
def draft_of(path: Path) -> Iterator[Path]:
    """A file in the same folder to write to; it replaces `path` at the end of the block.

    A process that is killed leaves `path` as it was. Raises OutputError for a device, and for a file that cannot be
    written.
    """
    _require_regular(path)
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield draft
        draft.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot write the file: {error.strerror}; give another file") from None
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def program() -> str:
    """Name and version of this program, as runs and results carry it."""
    from importlib.metadata import version  # slow to import

    return f"inertial-rig {version('inertial-rig')}"


# The folder of the record is `RIG_HOME`, else the user's data folder.

RECORD = "RIG_RECORD"  # URL of a lab's record, to read it instead of the rig's own
LAB = "RIG_LAB"  # URL of the lab's record for `rig push`


SHARED = Path("/tmp")  # noqa: S108 not TMPDIR: two shells with different ones would not see each other's locks


def machine() -> Path:
    """The folder of locks that all users and all folders of records on this machine share."""
    folder = SHARED / "inertial-rig"
    folder.mkdir(parents=True, exist_ok=True)
    with suppress(OSError):  # another user made it
        folder.chmod(0o777)
    return folder


def home() -> Path:
    """The folder of the record. The first write makes it."""
    if folder_name := os.environ.get("RIG_HOME"):
        return Path(folder_name).expanduser()
    import platformdirs

    return Path(platformdirs.user_data_dir("inertial-rig"))


def choose_kernel_cache() -> None:
    """Cache compiled kernels in the folder of the record if the user's home is read-only, as for a service.

    Call it before numba is imported: without a place for its cache, numba fails.
    """
    user_home = os.environ.get("HOME", "")
    places = (user_home, f"{user_home}/.cache", os.environ.get("XDG_CACHE_HOME", ""))
    if not any(os.access(place, os.W_OK) for place in places):
        os.environ.setdefault("NUMBA_CACHE_DIR", str(home() / "kernels"))


def free_bytes(folder: Path) -> int:
    """Free bytes on the disk of `folder`, which need not exist yet."""
    existing = next(place for place in (folder, *folder.resolve().parents) if place.exists())
    return shutil.disk_usage(existing).free
