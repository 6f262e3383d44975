"""The help on a procedure says what each of its settings means."""

import pytest

from procedures.catalogue import find, paths
from procedures.settings import meaning


@pytest.mark.parametrize("name", list(paths(None)))
def test_every_setting_has_a_meaning(name: str) -> None:
    procedure = find(name, None)
    assert not [setting for setting in procedure.defaults if not meaning(procedure, setting)]


@pytest.mark.parametrize("name", list(paths(None)))
def test_no_meaning_repeats_a_name_of_the_program(name: str) -> None:
    """A person reads `--rest-s`; `rest_s` in a sentence is another language."""
    procedure = find(name, None)
    text = " ".join(meaning(procedure, setting) for setting in procedure.defaults)
    assert not [setting for setting in procedure.defaults if "_" in setting and setting in text]
