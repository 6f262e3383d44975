"""push: copy finished runs to the lab's record, a PostgreSQL database of many rigs."""

from __future__ import annotations

from pathlib import Path

import click
from click.core import ParameterSource
from sqlalchemy import URL

from rig.bench import read_bench
from rig.cli.terminal.options import require_no_password
from rig.cli.terminal.output import bench_option, emit, json_option, note
from rig.errors import RecordError
from rig.files import LAB
from rig.lab_url import lab_url, mask_url
from rig.record import Record
from rig.record.lab import READER, WRITER, prepare
from rig.record.push import PushedRun, push_all, unsent, verify


def _check_url(context: click.Context, _: click.Parameter, url: str | None) -> str | None:
    if url is not None and context.get_parameter_source("given") is ParameterSource.COMMANDLINE:
        require_no_password(url, LAB)
    return url


@click.command("push")
@click.argument("named", metavar="[RUNS]...", nargs=-1)
@click.option(
    "--to",
    "given",
    envvar=LAB,
    callback=_check_url,
    metavar="URL",
    help=f"postgresql://USER@HOST/DATABASE; else {LAB}.",
)
@click.option(
    "--prepare", "prepares", is_flag=True, help="Create the record and its roles, as the owner of the database."
)
@click.option(
    "--verify", "verifies", is_flag=True, help="Recompute and compare the digest of every run in the lab's record."
)
@bench_option
@json_option
def push_command(
    named: tuple[str, ...], given: str | None, prepares: bool, verifies: bool, bench_file: Path | None, as_json: bool
) -> int:
    """Push RUNS, or all finished runs that the lab does not have or has in another version.

    The lab's record is named by --to, by RIG_LAB, or in the bench file (lab: {url: ...}). After an interruption the
    command continues; it sends nothing twice. Exit status 1: the lab refused a run, and the others were pushed; or
    --verify found a run that has changed since it arrived.
    """
    if (prepares or verifies) and named:
        raise click.UsageError("--prepare and --verify apply to the whole record; remove the runs")
    url = _lab(given, bench_file)
    if prepares:
        _prepare(url, as_json)
        return 0
    return _verify(url, as_json) if verifies else _push(url, named, as_json)


def _lab(url: str | None, bench_file: Path | None) -> URL:
    if url is None and bench_file is not None and (lab := read_bench(bench_file).lab) is not None:
        url = lab.url
    if url is None:
        raise click.UsageError(
            "the lab's record is not known: give --to postgresql://USER@HOST/DATABASE, "
            f"set {LAB}, or give a bench file with `lab: {{url: ...}}`"
        )
    return lab_url(url)


def _push(url: URL, run_names: tuple[str, ...], as_json: bool) -> int:
    pushed_runs: list[PushedRun] = []
    refusals: list[RecordError] = []
    with Record() as local, Record(url) as lab:
        waiting = unsent(local, lab, run_names)
        for number, pushed in enumerate(push_all(local, lab, waiting), 1):
            if isinstance(pushed, RecordError):
                refusals.append(pushed)
            else:
                pushed_runs.append(pushed)
            note(f"{number} of {len(waiting)}: {pushed if isinstance(pushed, RecordError) else _description(pushed)}")
    if refusals and len(waiting) == 1:
        raise refusals[0]
    if as_json:
        emit({"schema": "rig.push/1", "to": mask_url(url), "runs": [vars(pushed) for pushed in pushed_runs]})
    else:
        count = f", {len(refusals)} refused" if refusals else ""
        click.echo(
            f"{len(pushed_runs)} runs pushed to {mask_url(url)}{count}"
            if waiting
            else f"{mask_url(url)} has all finished runs"
        )
    return int(bool(refusals))


def _description(pushed: PushedRun) -> str:
    return pushed.run if pushed.name == pushed.run else f"{pushed.run}, in the lab {pushed.name}"


def _prepare(url: URL, as_json: bool) -> None:
    schema_before = prepare(url)
    if as_json:
        emit({"schema": "rig.prepared/1", "to": mask_url(url), "before": schema_before})
        return
    state = f"the record, schema {schema_before}, is up to date" if schema_before else "created the record"
    click.echo(f"{mask_url(url)}: {state}. Give each rig and each reader its own role:")
    click.echo(f"  CREATE ROLE rig7 LOGIN PASSWORD '...' IN ROLE {WRITER};   -- pushes, reads")
    click.echo(f"  CREATE ROLE anna LOGIN PASSWORD '...' IN ROLE {READER};   -- reads")


def _verify(url: URL, as_json: bool) -> int:
    with Record(url) as lab:
        verified = verify(lab)
    if as_json:
        emit({"schema": "rig.verified/1", "record": mask_url(url), **vars(verified)})
    else:
        click.echo(f"{len(verified.sound)} runs unchanged, {len(verified.on_their_way)} incomplete")
        for run in verified.changed:
            click.echo(f"{run}: has changed since it arrived; `rig show {run} --record URL` lists its events")
    return int(bool(verified.changed))
