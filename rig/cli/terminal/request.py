"""The options that the analysis commands share, as one argument `request`."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

from rig.cli.terminal.output import Positive, bench_option, json_option
from rig.services.request import Request

OPTIONS = (
    bench_option,
    click.option(
        "--noise",
        help="A noise model of this sensor, fitted to a still record: slow noise is then known, and not guessed.",
    ),
    click.option("--channel", help="Of a still record: vx, vy ... Default: every axis."),
    click.option("--rate", "rate_hz", type=Positive(), help="Samples a second, for an array (.npy)."),
    json_option,
)


def request_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """--bench, --noise, --channel and --rate go, with the command's own DATA and --model, into `request`; and --json.

    Of several DATA the request is about the first, and the command gets them all as `several`.
    """

    @wraps(function)
    def inside(
        data: str | tuple[str, ...],
        model: str | None,
        bench_file: Path | None,
        noise: str | None,
        channel: str | None,
        rate_hz: float | None,
        **others: Any,
    ) -> Any:
        several = {"several": data} if isinstance(data, tuple) else {}
        first = data if isinstance(data, str) else next(iter(data), "")
        return function(request=Request(first, model, bench_file, noise, channel, rate_hz), **several, **others)

    for option in reversed(OPTIONS):
        inside = option(inside)
    return inside
