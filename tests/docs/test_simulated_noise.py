"""docs/simulated-noise.md names every option of the simulated noise with its default, and its example is a world."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest
import yaml

from drivers.world.config import WorldConfig
from drivers.world.noise import Noise
from drivers.world.pickup import Floor

TEXT = (Path(__file__).parents[2] / "docs" / "simulated-noise.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("title", "options"), [("noise", Noise), ("floor", Floor)])
def test_every_option_is_there_with_its_default_and_no_other(title: str, options: type) -> None:
    section = TEXT.partition(f"## `{title}`")[2].partition("\n## ")[0]
    rows = dict(re.findall(r"^\| `(\w+)` \| (\S+) \| [^|]+ \| [^|]+ \|", section, re.MULTILINE))
    assert rows == {field.name: str(field.default) for field in fields(options)}


def test_the_example_is_a_valid_simulated_world() -> None:
    said = yaml.safe_load(re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)[0])["world"]
    world = WorldConfig.from_mapping(said)
    assert (world.noise.x.hum_v, world.noise.y.hum_v, world.noise.y.wander_s) == (2e-4, 0.0, 20.0)
    assert world.noise.x.flicker_v == world.noise.y.flicker_v == 5e-5
    assert world.floor.shaking_hz == 7.3


@pytest.mark.parametrize("name", ["converter: {noise_v", "supply: {wander_v", "heat: {ambient_wander_k"])
def test_what_is_named_beside_exists(name: str) -> None:
    assert name in TEXT
    WorldConfig.from_mapping(yaml.safe_load(f"{name}: 0.001}}"))
