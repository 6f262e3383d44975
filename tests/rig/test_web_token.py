"""The token of the workbench lasts, is private, and is replaced when asked."""

from __future__ import annotations

from pathlib import Path

import pytest

from rig.web.guard import NAME, kept_token


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file of the token, in a home that does not exist yet."""
    monkeypatch.setenv("RIG_HOME", str(tmp_path / "home"))
    return tmp_path / "home" / NAME


def test_a_token_lasts_and_only_its_owner_reads_it(kept: Path) -> None:
    token = kept_token()
    assert kept_token() == token == kept.read_text()
    assert kept.stat().st_mode & 0o777 == 0o600


def test_a_new_token_replaces_the_kept_one(kept: Path) -> None:
    before = kept_token()
    after = kept_token(new=True)
    assert after != before
    assert kept_token() == after


@pytest.mark.parametrize("spoil", [lambda path: path.chmod(0o644), lambda path: path.write_text("short")])
def test_a_token_that_others_read_or_that_is_damaged_is_replaced(kept: Path, spoil: object) -> None:
    before = kept_token()
    assert callable(spoil)
    spoil(kept)
    assert kept_token() != before
    assert kept.stat().st_mode & 0o777 == 0o600


def test_a_token_that_cannot_be_stored_is_valid_for_this_start(kept: Path) -> None:
    kept.parent.write_text("a file where the folder would be")
    assert len(kept_token()) == 32
