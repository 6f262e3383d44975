"""One definition of an identified process: the parameter table of every command and `rig noise` agree."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.criteria import IDENTIFIED
from calibrations.model.file import read_model
from calibrations.noise.analysis import analyse
from calibrations.noise.fit import fit, gain_of
from calibrations.noise.record import Samples, Still, reduce_record
from tests.calibrations import noises

WALK = "rate-random-walk"


def still(walk: float) -> Still:
    random = np.random.default_rng(3)
    samples = random.standard_normal(2048) + walk * noises.random_walk(random, 2048)
    return reduce_record([Samples("x", [samples], 1.0, "V")], "test")


@pytest.mark.parametrize("walk", [0.0, 0.003, 0.05])
def test_the_table_identifies_what_the_likelihood_ratio_does(walk: float) -> None:
    found = fit(read_model("still"), still(walk))
    effect = next(each for each in analyse(found.still).search.effects.values() if each.name == WALK)
    wider = fit(found.model.with_effect(effect), found.still)
    strength = next(term for term in wider.model.terms if term.name == WALK).estimates[0]
    assert strength.identified == (gain_of(wider.channels[0], effect) > IDENTIFIED)
    assert strength.identified == (walk == 0.05)


def test_rig_noise_repeats_the_estimates_of_the_search() -> None:
    analysis = analyse(still(0.05))
    shown = analysis.channels["x"].coefficients
    for term in analysis.search.end.model.terms:
        strength = term.estimates[0]
        assert shown[term.name].identified == strength.identified
        if strength.identified:
            assert (shown[term.name].value, shown[term.name].std) == (strength.value, strength.std)
