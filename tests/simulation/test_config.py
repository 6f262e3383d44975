from __future__ import annotations

from dataclasses import FrozenInstanceError, fields, is_dataclass

import pytest

from drivers.world.config import WorldConfig
from drivers.world.errors import BadSetting, SimulationError, UnknownSetting
from drivers.world.initial_state import individual
from drivers.world.kernel import record


def test_a_mapping_changes_a_preset() -> None:
    config = WorldConfig.from_mapping({"preset": "ideal", "heat": {"ambient_c": 20}})
    assert config == WorldConfig.ideal().changed({"heat": {"ambient_c": 20.0}})
    assert WorldConfig.from_mapping({}) == WorldConfig.adxl203() != WorldConfig.ideal()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"haet": {}}, ["'haet'", "'heat'"]),
        ({"sensor": {"x": {"plates": {"gap_nm": 3}}}}, ["'sensor.x.plates.gap_nm'", "'gap_um'"]),
        ({"preset": "adxl204"}, ["'adxl204'", "'adxl203'"]),
    ],
)
def test_an_unknown_key_is_refused_with_its_place_and_the_nearest_name(settings: dict, words: list[str]) -> None:
    with pytest.raises(UnknownSetting) as error:
        WorldConfig.from_mapping(settings)
    assert all(word in str(error.value) for word in words)


@pytest.mark.parametrize("value", ["warm", None, True, [1.0], float("nan")])
def test_a_value_must_be_a_number(value: object) -> None:
    with pytest.raises(BadSetting, match=r"heat\.ambient_c"):
        WorldConfig.from_mapping({"heat": {"ambient_c": value}})


def test_a_section_must_be_a_mapping() -> None:
    with pytest.raises(SimulationError, match="Give a mapping of alpha, beta"):
        WorldConfig.from_mapping({"stages": 3})


def test_settings_are_frozen() -> None:
    with pytest.raises(FrozenInstanceError):
        WorldConfig.ideal().heat.ambient_c = 3.0


UNITS = ("v", "g", "g2", "deg", "nm", "um", "um2", "pm", "hz", "s", "k", "h", "c", "ohm", "farad", "fraction", "cycles")
UNITS += ("mm", "m2", "ut", "mt2", "ppm", "ratio")


def leaves(settings: object) -> list[tuple[str, float]]:
    pairs = [(f.name, getattr(settings, f.name)) for f in fields(settings)]
    nested = [pair for _, value in pairs if is_dataclass(value) for pair in leaves(value)]
    return [(name, value) for name, value in pairs if not is_dataclass(value)] + nested


def test_every_setting_is_a_number_and_a_record_holds_them_all() -> None:
    config = WorldConfig.adxl203()
    assert all(isinstance(value, float) for _, value in leaves(config))
    numbers = record(config)
    assert numbers.sensor.x.plates.gap_um == config.sensor.x.plates.gap_um
    assert numbers.heat.ambient_c == config.heat.ambient_c


def test_every_name_carries_its_unit() -> None:
    units = set(UNITS)
    unnamed = {name for name, _ in leaves(WorldConfig.ideal()) if name.rsplit("_", 1)[-1] not in units}
    assert unnamed == set()


def test_individuals_differ_but_the_seed_decides() -> None:
    config = WorldConfig.adxl203()
    assert individual(config, 1) == individual(config, 1) != individual(config, 2)
    zeros = {individual(config, seed).sensor.x.plates.zero_g_v for seed in range(100)}
    assert len(zeros) == 100
    assert max(abs(zero - 2.5) for zero in zeros) < 0.1


def test_absent_imperfections_stay_absent_and_design_values_exact() -> None:
    drawn = individual(WorldConfig.ideal(), 4)
    assert drawn.sensor.x.springs == WorldConfig.ideal().sensor.x.springs
    assert drawn.stages == WorldConfig.ideal().stages
    assert drawn.sensor.x.plates.gap_um == 1.0
