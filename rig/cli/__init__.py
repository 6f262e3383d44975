"""The command line. A command is a function `NAME_command` in a module of `rig/cli/commands`, and a line in SECTIONS.

It returns nothing, or the exit status (1: done, and a limit or check was not met).
"""

from __future__ import annotations

import atexit
import gc
import importlib
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import click

from rig.cli.terminal.compiling import say_when_compiling
from rig.cli.terminal.failure import exit_status
from rig.cli.terminal.options import with_record
from rig.files import choose_kernel_cache

SECTIONS: Mapping[str, Mapping[str, tuple[str, str]]] = {  # of `rig --help`: command -> its module, its line
    "Start": {
        "demo": ("demo", "find three hidden faults of a simulated sensor, and compare them with the true ones"),
        "web": ("web", "the workbench in a browser: models, runs, record and comparison"),
    },
    "Measure": {
        "check": ("bench", "connect to every instrument of the bench, identify and test it; list certificates"),
        "procedures": ("lists", "list the procedures with their purposes and settings"),
        "plan": ("plan", "dry run of a procedure: every move, its limits, its duration; nothing moves"),
        "run": ("run", "run a procedure on the bench, guided or --unattended, and record it"),
        "resume": ("run", "continue an interrupted run at its first missing pose"),
        "runs": ("lists", "list the runs of the record, newest first"),
        "show": ("record", "show one run: its settings, its events, its results"),
        "import": ("import_", "store a file in the record as a run"),
        "exclude": ("record", "exclude a pose from every analysis, with a reason, or include it again"),
        "draw": ("bench", "draw the stages and the mounting of the sensor, as an SVG file or in the terminal"),
        "simulate": ("bench", "serve the simulated instruments in real time for any client"),
    },
    "Find what is missing": {
        "compare": ("discovery", "compare a model with data, and show where it fails"),
        "fit": ("fit", "estimate a model's parameters from data, with uncertainties"),
        "diagnose": ("discovery", "find the physical effect that a model misses"),
        "add": ("discovery", "add one physical effect, from the catalogue or your own, to a model"),
        "discover": ("discovery", "add missing effects until no effect is missing"),
        "noise": ("noise", "Allan deviation and noise coefficients of a still record"),
        "report": ("report", "write a self-contained page on data and model, or its pictures"),
        "effects": ("lists", "list the catalogue of physical effects, or show one"),
        "models": ("lists", "list the shipped models"),
    },
    "Hand over": {
        "certificate": ("report", "a calibration certificate for people (HTML, PDF) and for machines (DCC XML)"),
        "compensate": ("compensation", "write the inverse of a model as source code for the product"),
        "export": ("record", "write a run, or a file, in another format"),
        "export-model": (
            "compensation",
            "write a model in the file format of PX4, ArduPilot, ROS, imucal, Kalibr or OpenVINS",
        ),
        "push": ("push", "copy finished runs to the lab's record, a PostgreSQL database of many rigs"),
    },
    "Look after": {
        "control": ("history", "control charts of the check standard; is the rig in control?"),
        "history": ("history", "all calibrations of a sensor, their stability, and the date of the next one"),
        "doctor": ("doctor", "check this installation, and write an archive for a maintainer"),
        "completion": ("doctor", "print the script that completes commands, runs and files in bash, zsh or fish"),
    },
    "Many sensors": {
        "fleet": (
            "fleet",
            "find the missing effects of thousands of sensors, and calibrate each with the statistics of its batch",
        ),
    },
}
COMMANDS = {name: entry for section in SECTIONS.values() for name, entry in section.items()}


class Commands(click.Group):
    """The commands. Their modules are imported when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 click calls it so
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"{__name__}.commands.{COMMANDS[cmd_name][0]}")
        return with_record(getattr(module, f"{cmd_name.replace('-', '_')}_command"))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if not args[0].startswith("-") and args[0] not in COMMANDS:
            from drivers.errors import did_you_mean
            from procedures.catalogue import paths

            if args[0] in paths():
                raise click.UsageError(f"{args[0]!r} is a procedure; run it with: rig run {' '.join(args)}", ctx)
            raise click.UsageError(f"no command {args[0]!r}.{did_you_mean(args[0], sorted(COMMANDS))}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        width = max(map(len, COMMANDS))
        for title, section in SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl([(name.ljust(width), summary) for name, (_, summary) in section.items()])


NEW_OBJECTS = 50_000  # objects between two garbage collections: imports make many objects, and none of them is garbage
COMPLETE = "_RIG_COMPLETE"  # set by the completion script of a shell


@click.command(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="inertial-rig", prog_name="rig")
def rig() -> None:
    """Calibrate inertial sensors on a rig, and find physical effects that their model misses.

    DATA is a file or a run of the record. MODEL is the name of a shipped model or a file. `rig demo` shows a
    calibration on the simulated rig.
    """


def last_joined(arguments: Sequence[str]) -> list[str]:
    """Join `last` and the name of a procedure after it to one word, so that a person need not type quotes."""
    from rig.cli.terminal.complete import LAST

    words = list(arguments)
    if LAST in words[:-1]:
        from procedures.catalogue import paths

        for k in reversed(range(len(words) - 1)):
            if words[k] == LAST and words[k + 1] in paths():
                words[k : k + 2] = [f"{LAST} {words[k + 1]}"]
    return words


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command and exit with its status; an error is one message."""
    # Before numpy is imported: the matrices are small, and threads that wait for each other slow a busy machine.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    choose_kernel_cache()
    if arguments is None:
        say_when_compiling()
        atexit.register(gc.freeze)  # the interpreter's last collection would take half a second after a run
    gc.set_threshold(NEW_OBJECTS)

    if instruction := os.environ.get(COMPLETE):  # the shell asks what may follow
        from rig.cli.terminal.complete import answer_shell

        raise SystemExit(answer_shell(rig, "rig", COMPLETE, instruction))

    def call() -> Any:
        words = last_joined(sys.argv[1:] if arguments is None else arguments)
        with rig.make_context("rig", words) as context:
            return rig.invoke(context)

    raise SystemExit(exit_status(call))
