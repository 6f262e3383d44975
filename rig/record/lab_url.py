"""The URL of a lab's record: postgresql://USER@HOST:PORT/DATABASE?sslmode=verify-full. Its password is never shown."""

from __future__ import annotations

from sqlalchemy import URL, make_url
from sqlalchemy.exc import ArgumentError

from rig.errors import RecordError

SECRET = ("password", "sslpassword")  # of what libpq takes beside the user's own
# A URL that is refused is not quoted: what is wrong with it may be where the password begins.
NO_URL = (
    "is no URL of a lab's record; write postgresql://USER@HOST/DATABASE, and in a password %40 for @, %2F for /; or "
    "leave the password to ~/.pgpass or PGPASSWORD"
)


def lab_url(given: str, what: str = "what was given") -> URL:
    """Parsed and checked. Raises RecordError, which says `what` is wrong and does not quote it."""
    try:
        url = make_url(given)
    except (ArgumentError, ValueError):
        raise RecordError(f"{what} {NO_URL}") from None
    scheme = url.drivername.partition("+")[0]
    if scheme not in ("postgresql", "postgres") or not url.database or "@" in f"{url.host}{url.database}":
        raise RecordError(f"{what} {NO_URL}")
    return url.set(drivername="postgresql+psycopg")


def shown(url: URL) -> str:
    """For people, records and logs: stars for a password."""
    return url.set(drivername="postgresql").difference_update_query(SECRET).render_as_string()


def has_password(url: URL) -> bool:
    """Whether it holds one that would be kept wherever the URL is."""
    return bool(url.password) or any(url.query.get(name) for name in SECRET)
