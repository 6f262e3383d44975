"""The simulated instruments in real time, for any client; and a bench of which a part is real."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from drivers.clock import WallClock
from drivers.labjack_t7 import driver as labjack_t7
from drivers.oriental_az import driver as oriental_az
from drivers.transport import Address, Links
from rig.bench import DEFAULT, read_bench
from rig.errors import Busy
from rig.instruments.instruments import connect_all
from tests.rig.conftest import Rig

pytestmark = pytest.mark.sockets

ENDING = (signal.SIGINT, signal.SIGTERM)


@pytest.fixture
def served() -> Iterator[tuple[subprocess.Popen[str], dict[str, Any]]]:
    """`rig simulate --json` in a process of its own, and the document that it prints."""
    command = [sys.executable, "-m", "rig", "simulate", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout
        try:
            yield child, json.loads(child.stdout.readline())
        finally:
            child.kill()


def test_drivers_find_the_instruments_at_the_printed_addresses(served: Any) -> None:
    _, document = served
    assert document["schema"] == "rig.addresses/1"
    instruments = document["instruments"]
    expected = {role: each.driver for role, each in read_bench().instruments.items()}
    assert {role: each["driver"] for role, each in instruments.items()} == expected
    links = Links(WallClock())
    alpha, adc = ({k: v for k, v in instruments[role].items() if k != "driver"} for role in ("alpha", "adc"))
    stage = oriental_az.connect(Address(**alpha), links, oriental_az.Settings(), "alpha")
    converter = labjack_t7.connect(Address(**adc), links, labjack_t7.Settings(), "adc")
    assert stage.angle_deg() == pytest.approx(0, abs=0.1)
    assert converter.identify().model == "LabJack T7"
    assert converter.acquire(0.02).volts.shape == (20, 3)
    links.close()


@pytest.mark.parametrize("number", ENDING)
def test_a_signal_ends_the_server_without_an_error(served: Any, number: signal.Signals) -> None:
    child, _ = served
    child.send_signal(number)
    assert child.wait(timeout=30) == 0
    assert child.stderr.read() == ""


def test_the_earlier_signal_handlers_are_restored(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    def ended_by_both(servers: object, until: Callable[[], bool], clock: object) -> None:
        assert not until()
        for each in ENDING:
            signal.raise_signal(each)
        assert until()

    before = [signal.getsignal(each) for each in ENDING]
    monkeypatch.setattr("rig.cli.commands.bench.serve_forever", ended_by_both)
    assert rig("simulate").status == 0
    assert [signal.getsignal(each) for each in ENDING] == before


@pytest.mark.slow
def test_a_bench_with_one_real_instrument_runs_in_real_time(
    served: Any, bench_file: Callable[..., Path], rig: Rig
) -> None:
    _, document = served
    instruments = yaml.safe_load(DEFAULT.read_text())["instruments"]
    for role in ("alpha", "beta"):
        instruments[role]["settings"] |= {"speed_deg_s": 1200, "acceleration_deg_s2": 36000}
    instruments["oven"]["url"] = document["instruments"]["oven"]["url"]  # elsewhere, so real for this bench
    path = bench_file({"instruments": instruments})
    with connect_all(read_bench(path)) as mixed:
        with pytest.raises(Busy, match=r"another process .* uses "), connect_all(read_bench(path)):
            pass  # its connecting would disturb who measures
        assert mixed.state() is None
        assert mixed.power_on_s() is None
        assert mixed.clock.now() < 60
        assert set(mixed.identities()) == set(instruments)
    settings = ("--step-deg", "180", "--inclinations-deg", "0", "--dwell-s", "0.01", "--settle-s", "0")
    asked = rig("run", "sweep", *settings, "--bench", str(path), "--json", "--unattended")
    assert (asked.status, asked.document["state"]) == (4, "stopped")
    assert 'the question "Is the sensor mounted face up' in asked.err
    path.with_name("answers.yaml").write_text("mounting: yes")
    answers = ("--answers", str(path.with_name("answers.yaml")))
    ended = rig("run", "sweep", *settings, "--bench", str(path), *answers, "--json", "--unattended")
    assert ended.status == 0, ended.err


def test_pseudo_terminals_are_served_where_the_bench_asks(bench_file: Callable[..., Path]) -> None:
    instruments = yaml.safe_load(DEFAULT.read_text())["instruments"]
    roles = ("alpha", "beta", "oven")
    instruments = {role: instruments[role] for role in (*roles, "adc")}
    for role in roles:
        instruments[role]["url"] = "simulated:pty:"
    with connect_all(read_bench(bench_file({"instruments": instruments}))) as rig:
        assert sorted(server.url.partition(":")[0] for server in rig.servers) == ["serial", "serial", "tcp"]
        assert set(rig.identities()) == set(instruments)
