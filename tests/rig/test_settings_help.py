"""The help on a procedure says what each of its settings means."""

import pytest

from procedures.catalogue import find, paths
from procedures.settings import meaning
from rig.cli.terminal.settings_help import procedure_text


@pytest.mark.parametrize("name", list(paths(None)))
def test_every_setting_has_a_meaning(name: str) -> None:
    procedure = find(name, None)
    assert not [setting for setting in procedure.defaults if not meaning(procedure, setting)]


def test_the_help_has_unit_default_and_meaning() -> None:
    text = procedure_text(find("sweep", None))
    assert "--step-deg  (default: 10 deg)\n        The step of beta. It divides 180.\n" in text
    assert "--settle-s  (default: 0.5 s)\n        How long the stages stand still before samples are taken." in text
    assert "half turns to each side at 90 deg. One of: grid, ang." in " ".join(text.split())


@pytest.mark.parametrize("name", list(paths(None)))
def test_no_meaning_repeats_a_name_of_the_program(name: str) -> None:
    """A person reads `--rest-s`; `rest_s` in a sentence is another language."""
    procedure = find(name, None)
    text = " ".join(meaning(procedure, setting) for setting in procedure.defaults)
    assert not [setting for setting in procedure.defaults if "_" in setting and setting in text]
