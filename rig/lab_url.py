"""The URL of the lab's record: postgresql://USER@HOST:PORT/DATABASE?sslmode=verify-full.

No message shows its password.
"""

from __future__ import annotations

from sqlalchemy import URL, make_url
from sqlalchemy.exc import ArgumentError

from rig.errors import RecordError

SECRET = ("password", "sslpassword")  # query keys of libpq
# The message does not quote a refused URL, because it may contain a password.
NO_URL = (
    "is not the URL of a lab's record; write postgresql://USER@HOST/DATABASE, and in a password %40 for @, %2F for /; "
    "or put the password into ~/.pgpass or PGPASSWORD"
)


def lab_url(text_url: str, source: str = "this") -> URL:
    """The parsed URL. Raises RecordError, which begins with `source` and does not quote the URL."""
    try:
        url = make_url(text_url)
    except (ArgumentError, ValueError):
        raise RecordError(f"{source} {NO_URL}") from None
    scheme = url.drivername.partition("+")[0]
    if scheme not in ("postgresql", "postgres") or not url.database or "@" in f"{url.host}{url.database}":
        raise RecordError(f"{source} {NO_URL}")
    return url.set(drivername="postgresql+psycopg")


def mask_url(url: URL) -> str:
    """The URL for messages and logs, with stars for a password."""
    return url.set(drivername="postgresql").difference_update_query(SECRET).render_as_string()


def has_password(url: URL) -> bool:
    """Whether the URL contains a password."""
    return bool(url.password) or any(url.query.get(name) for name in SECRET)
