"""The help on a procedure says what each of its settings means."""

import pytest

from procedures.catalogue import find, paths
from rig.cli.terminal.settings_help import meaning, procedure_text


@pytest.mark.parametrize("name", list(paths(None)))
def test_every_setting_has_a_meaning(name: str) -> None:
    procedure = find(name, None)
    assert not [setting for setting in procedure.defaults if not meaning(procedure, setting)]


def test_the_help_has_unit_default_and_meaning() -> None:
    text = procedure_text(find("sweep", None))
    assert "--step-deg 10\n        In deg. The grid has every step_deg of a full turn of beta" in text
    assert "--settle-s 0.5\n        In s. How long the stages stand still before samples are taken." in text
