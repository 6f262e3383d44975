"""Run: the bench, a procedure with its plan, and the run that is under way."""

from __future__ import annotations

from datetime import UTC, datetime

from fastapi import Request
from nicegui import ui

from rig.bench import Bench, read_bench
from rig.bench.certificates import expired
from rig.instruments.instruments import checked
from rig.web.desk import Desk
from rig.web.frame import Key, frame
from rig.web.pages.run_live import Live
from rig.web.pages.run_plan import Planning
from rig.web.parts import box, div, failed, message, off_loop, table, waiting, words


def register(desk: Desk) -> None:
    """The page at /run; a procedure and its settings may be part of the address."""

    @ui.page("/run")
    def page(request: Request) -> None:
        with frame(desk, "/run") as keys:
            try:
                bench = read_bench(desk.bench_file)
            except Exception as error:
                failed("The bench file cannot be used", message(error))
                return
            with div("run-page"):
                with div("stack"):
                    planning = Planning(desk, bench, dict(request.query_params))
                    Instruments(bench)
                with div("stack"):
                    live = Live()
                    planning.lay_out_plan()
            planning.started = live.look
            keys["s"] = Key("start the planned run", planning.start)
            keys["p"] = Key("pause the run, or go on", live.pause_or_go_on)


class Instruments:
    """What is on the bench, and whether it answers."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        with box("stack"):
            words("Bench", "title")
            words(bench.name, "quiet small")
            for fault in expired(bench, datetime.now(UTC).date()):
                words(f"{fault}; have it calibrated again", "fault")
            self.rows = div("")
            with self.rows:
                table(
                    ("role", "instrument", "at"), [(r, i.driver, _where(i.url)) for r, i in bench.instruments.items()]
                )
            ui.button("Check the instruments", icon="fact_check", on_click=self.check).props("outline dense")

    async def check(self) -> None:
        """Let every instrument say who it is, and test itself."""
        self.rows.clear()
        with self.rows:
            waiting("Connecting; nothing moves")
        try:
            found = await off_loop(checked, self.bench)
        except Exception as error:
            self.rows.clear()
            with self.rows:
                failed("The bench cannot be checked", message(error))
            return
        rows = [
            (role, f"{'✓' if test.ok else '✗ FAILED'} {test.name}", test.detail)
            for role, (_, tests) in found.items()
            for test in tests
        ]
        self.rows.clear()
        with self.rows:
            table(("role", "check", "detail"), rows)


def _where(url: str) -> str:
    return "simulated" if url.startswith("simulated") else url
