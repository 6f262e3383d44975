"""A user's own effects, brought to workers as texts: these need not see the folder that the bench file names."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

from calibrations.effects import Effect
from calibrations.effects.catalogue import LOG, catalogue
from rig.services.load import effects_of as checked

Own = tuple[tuple[str, str], ...]  # names and texts of Python files


def own_files(bench_file: Path | None) -> Own:
    """The files in the folder of effects that a bench file names. Raises ModelError for one that is no effect."""
    if bench_file is None:
        return ()
    from rig.bench import read_bench

    checked(bench_file)
    folder = read_bench(bench_file).folders.effects
    files = sorted(folder.glob("*.py")) if folder is not None else []
    return tuple((path.name, path.read_text(encoding="utf-8")) for path in files)


@lru_cache(maxsize=8)
def effects_of(own: Own) -> Mapping[str, Effect]:
    """The shipped effects and those of a user's files. Raises ModelError."""
    if not own:
        return catalogue()
    with TemporaryDirectory(prefix="effects-") as folder:
        for name, text in own:
            Path(folder, name).write_text(text, encoding="utf-8")
        LOG.addFilter(_silent)
        try:
            return catalogue(Path(folder))
        finally:
            LOG.removeFilter(_silent)


def _silent(_: logging.LogRecord) -> bool:
    """That files of one's own are run is said once, of the folder that one named."""
    return False
