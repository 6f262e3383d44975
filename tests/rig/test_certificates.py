"""An expired certificate marks what was measured with its instrument, wherever that is shown."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

import pytest
import yaml

from rig.bench import DEFAULT, Bench
from rig.bench.certificates import certificates, find_expired
from tests.rig.conftest import Rig

OLD, GOOD = {"number": "CAL-17", "due": "2001-03-01"}, {"number": 42, "due": "2999-12-31"}
MARK = "beta's certificate CAL-17 expired on 2001-03-01"
SWEEP = ("run", "sweep", "--inclinations-deg", "90", "--step-deg", "45", "--dwell-s", "0.2", "--unattended")


def bench(beta: dict[str, Any], curve: dict[str, Any]) -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load(DEFAULT.read_text())
    document["instruments"]["beta"]["certificate"] = beta
    return document | {"certificates": {"d63 curve": curve}}


@pytest.fixture
def file(tmp_path: Path) -> Callable[..., str]:
    def write(*parts: dict[str, Any]) -> str:
        (tmp_path / "bench.yaml").write_text(yaml.safe_dump(bench(*parts)))
        return str(tmp_path / "bench.yaml")

    return write


def test_a_certificate_is_good_until_the_end_of_its_day() -> None:
    made = Bench.model_validate(bench({"number": "CAL-17", "due": "2027-03-01"}, GOOD))
    assert list(certificates(made)) == ["beta", "d63 curve"]
    assert find_expired(made, date(2027, 3, 1)) == []
    assert find_expired(made, date(2027, 3, 2)) == ["beta's certificate CAL-17 expired on 2027-03-01"]
    assert len(find_expired(made, date(3000, 1, 1))) == 2


@pytest.mark.sockets
def test_check_shows_what_is_due_and_fails_for_what_has_expired(rig: Rig, file: Callable[..., str]) -> None:
    ended = rig("check", "--bench", file(OLD, GOOD))
    assert ended.status == 1
    assert ended.out.endswith("beta: certificate CAL-17, due 2001-03-01\nd63 curve: certificate 42, due 2999-12-31\n")
    assert f"{MARK}; have it calibrated again" in ended.err
    document = rig("check", "--bench", file(OLD, GOOD), "--json").document
    assert document["certificates"]["d63 curve"] == {"number": "42", "due": "2999-12-31"}
    assert document["expired"] == [MARK]
    assert rig("check", "--bench", file(GOOD, GOOD)).status == 0


@pytest.mark.slow
@pytest.mark.sockets
def test_a_run_with_an_expired_one_is_marked_everywhere(rig: Rig, file: Callable[..., str], tmp_path: Path) -> None:
    ended = rig(*SWEEP, "--bench", file(OLD, GOOD), "--json")
    document = ended.document
    assert (ended.status, document["expired"]) == (0, MARK)
    shown = rig("show", document["run"], "--json").document
    assert shown["expired"] == shown["constants"]["expired"] == MARK
    assert [event["text"] for event in shown["events"] if event["what"] == "expired"] == [MARK]
    assert f"Remark: {MARK}." in rig("show", document["run"]).out
    out = tmp_path / "data.csv"
    rig("export", document["run"], "--out", str(out))
    assert f"# expired: {MARK}\n" in out.read_text()
    page = tmp_path / "page.html"
    rig("report", str(out), "--out", str(page))
    assert page.read_text().count("certificate CAL-17 expired on 2001-03-01.") == 1  # the summary's; and as a constant
    assert page.read_text().count("certificate CAL-17 expired on 2001-03-01") == 2


@pytest.mark.sockets
def test_a_run_with_valid_certificates_has_no_remark(rig: Rig, file: Callable[..., str]) -> None:
    ended = rig(*SWEEP, "--bench", file(GOOD, GOOD), "--json")
    document = ended.document
    assert document["expired"] is None
    assert rig("show", document["run"], "--json").document["expired"] is None
    assert "expired" not in rig(*SWEEP, "--bench", file(GOOD, GOOD)).out
    assert f"Remark: {MARK}." in rig(*SWEEP, "--bench", file(OLD, GOOD)).out
