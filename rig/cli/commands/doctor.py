"""doctor and completion: check the installation, and complete words in a shell."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
from click.shell_completion import get_completion_class

from rig.cli import COMPLETE, rig
from rig.cli.terminal.output import FOLDER, bench_option, emit, json_option, out_option, require_outputs
from rig.files import draft_of, home
from rig.services.health import Finding, collect_part, findings, last_run, list_runs, versions, without_secrets


@click.command("doctor")
@out_option("The archive. Default: a name with the time.")
@click.option("--run", "run", help="The run whose log goes into the archive. Default: the newest.")
@click.option(
    "--recover",
    "folder",
    type=FOLDER,
    help="Only copy the readable rows of a damaged record to a new record in this folder.",
)
@bench_option
@json_option
def doctor_command(
    out: Path | None, run: str | None, folder: Path | None, bench_file: Path | None, as_json: bool
) -> int:
    """Check packages, disk and record, and write an archive for a maintainer. Exit status 1: a check fails.

    The archive has versions, checks, the list of runs, the bench, and the log of one run. It has no samples, and no
    passwords, tokens or keys of the bench file. Look at it before you send it.
    """
    if folder is not None:
        return _recover(folder, as_json)
    checked = findings()
    archive = out or Path(f"rig-doctor-{datetime.now(UTC):%Y%m%d-%H%M%S}.zip")
    require_outputs(archive)
    parts = _parts(checked, run, bench_file)
    _write(archive, parts)
    if as_json:
        checks = {finding.what: {"ok": finding.ok, "said": finding.detail} for finding in checked}
        emit({"schema": "rig.doctor/1", "checks": checks, "archive": str(archive), "files": sorted(parts)})
    else:
        click.echo("check")
        for finding in checked:
            click.echo(f"{finding.what:8}  {'ok' if finding.ok else 'WRONG':5}  {finding.detail}")
        click.echo(f"\n{archive}: {', '.join(sorted(parts))}. It has no samples; look at it before you send it.")
    return int(not all(finding.ok for finding in checked))


def _parts(checked: list[Finding], run: str | None, bench_file: Path | None) -> Mapping[str, Any]:
    """The files of the archive: JSON documents by name."""
    parts: dict[str, Any] = {"versions.json": versions(), "checks.json": [vars(finding) for finding in checked]}
    parts["runs.json"] = collect_part(list_runs)
    parts["run.json"] = last_run(run) if run is not None else collect_part(last_run)
    if bench_file is not None:
        parts["bench.json"] = collect_part(lambda: _bench_document(bench_file))
    return parts


def _bench_document(bench_file: Path) -> Any:
    from rig.bench import read_bench

    return without_secrets(read_bench(bench_file).document())


def _write(archive: Path, parts: Mapping[str, Any]) -> None:
    with draft_of(archive) as draft, zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as file:
        for name, document in parts.items():
            file.writestr(name, json.dumps(document, indent=1, default=str))


def _recover(folder: Path, as_json: bool) -> int:
    """Recover the record; print the copied and the lost rows."""
    from rig.record.recover import recover

    recovery = recover(home() / "record.db", folder)
    losses = [
        *(f"some rows of {table}" for table in recovery.damaged),
        *(f"the samples of {pose}" for pose in recovery.spoilt),
    ]
    losses += recovery.changed
    if as_json:
        emit({"schema": "rig.recovered/1", "folder": str(folder), "rows": dict(recovery.rows), "lost": losses})
    else:
        rows = ", ".join(f"{count} {table}" for table, count in recovery.rows.items() if count)
        click.echo(f"{folder}: {rows or 'nothing'}")
        click.echo(f"lost: {'; '.join(losses) or 'nothing'}. RIG_HOME={folder} uses this record.")
    return int(bool(losses))


SHELLS = ("bash", "zsh", "fish")


@click.command("completion")
@click.argument("shell", type=click.Choice(SHELLS))
def completion_command(shell: str) -> None:
    """Print the completion script for SHELL.

    \b
    bash   in ~/.bashrc:                   eval "$(rig completion bash)"
    zsh    in ~/.zshrc, after compinit:    eval "$(rig completion zsh)"
    fish   in ~/.config/fish/config.fish:  rig completion fish | source

    The Tab key then completes commands, options, procedures, effects, runs, sensors and files.
    """
    completion = get_completion_class(shell)
    if completion is None:
        raise click.UsageError(f"click has no completion for {shell}")
    click.echo(completion(rig, {}, "rig", COMPLETE).source())
