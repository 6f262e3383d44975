"""Defects of a rig, each one mechanism: for tests that hide one and look for it.

A defect names its knobs by their place in WorldConfig, with their values at size 1; a `*` stands for
both sensing axes. Sizes scale the knobs, y gets its own share, since no two axes are alike:

    config.changed(DEFECTS["plate mismatch"].settings(0.5, y_share=0.7))
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Defect:
    """One mechanism: what happened, the knobs that grow with its size, the settings that come with it."""

    story: str
    knobs: Mapping[str, float]
    fixed: Mapping[str, float] = field(default_factory=dict)

    def settings(self, size: float, y_share: float = 1.0) -> dict[str, Any]:
        """Changes for `WorldConfig.changed`."""
        changes: dict[str, Any] = {}
        for path, value in self.knobs.items():
            for place, share in _places(path, y_share):
                _set_nested(changes, place, size * share * value)
        for path, value in self.fixed.items():
            for place, _ in _places(path, y_share):
                _set_nested(changes, place, value)
        return changes


def _places(path: str, y_share: float) -> Iterator[tuple[str, float]]:
    if "*" not in path:
        yield path, 1.0
    else:
        yield path.replace("*", "x"), 1.0
        yield path.replace("*", "y"), y_share


def _set_nested(changes: dict[str, Any], path: str, value: float) -> None:
    *sections, name = path.split(".")
    for section in sections:
        changes = changes.setdefault(section, {})
    changes[name] = value


DEFECTS: dict[str, Defect] = {
    "plate mismatch": Defect(
        "a finger's two fixed plates differ in area",
        {"sensor.*.plates.plate_mismatch_fraction": 0.1},
    ),
    "hardening springs": Defect(
        "beams grow stiffer as they bend",
        {"sensor.*.springs.hardening_per_um2": 15.0},
    ),
    "one-sided springs": Defect(
        "springs are stiffer to one side than to the other",
        {"sensor.*.springs.one_sided_fraction": 2e-3},
    ),
    "blind amplifier": Defect(
        "the amplifier does not see small displacements",
        {"sensor.*.plates.dead_band_nm": 0.01},
    ),
    "foreshortened beams": Defect(
        "beams that bend under the neighbouring axis's load draw the mass aside",
        {"sensor.*.springs.foreshortening_per_um": 0.2},
    ),
    "sliding overlap": Defect(
        "the neighbouring axis's load changes the overlap of the plates",
        {"sensor.*.plates.overlap_slide_per_um": 0.6},
        {"sensor.*.plates.stray_fraction": 1.0},
    ),
    "foreshortened by sag": Defect(
        "beams that sag draw the mass aside",
        {"sensor.*.springs.sag_foreshortening_per_um": 0.05},
    ),
    "overlap lost by sag": Defect(
        "plates that sag overlap less",
        {"sensor.*.plates.overlap_loss_per_um2": 24.0},
        {"sensor.*.plates.stray_fraction": 1.0},
    ),
    "package turned": Defect(
        "the package was soldered askew",
        {"sensor.package.turn_x_deg": 0.05, "sensor.package.turn_y_deg": -0.07, "sensor.package.turn_z_deg": 0.1},
    ),
    "beams off square": Defect(
        "the y beam is not at 90 deg to the x beam",
        {"sensor.package.beams_off_square_deg": 0.1},
    ),
    "slipping contacts": Defect(
        "contacts in the suspension stick and slip",
        {"sensor.*.friction.stiffness_fraction": 3e-4},
    ),
    "package stress": Defect(
        "the package bends the die as it warms",
        {"sensor.*.springs.stress_pm_per_k": 4.0},
    ),
    "softening by heat": Defect(
        "springs change their stiffness as they warm",
        {"sensor.*.springs.stiffening_ppm_per_k": -400.0},
    ),
    "creeping glue": Defect(
        "the die's glue follows the temperature with play",
        {"sensor.*.springs.stress_pm_per_k": 8.0},
        {"heat.glue_play_k": 1.5},
    ),
    "creeping charge": Defect(
        "charge creeps into the plates' oxide after power-on",
        {"sensor.*.plates.charging_pm": 5.0},
        {"heat.powered_for_s": 0.0},
    ),
    "stage zero": Defect(
        "the stages' marks are not at zero",
        {"stages.alpha.zero_offset_deg": 0.05, "stages.beta.zero_offset_deg": -0.07},
    ),
    "gear play": Defect(
        "the beta stage's gear has play",
        {"stages.beta.play_deg": 0.1},
    ),
    "eccentric stage": Defect(
        "the beta stage's bearing is eccentric",
        {"stages.beta.wobble_deg": 0.07},
        {"stages.beta.wobble_phase_deg": 30.0},
    ),
    "tilted base": Defect(
        "the rig does not stand level",
        {"base.tilt_x_deg": 0.05, "base.tilt_y_deg": 0.04},
    ),
    "unsteady supply": Defect(
        "the supply voltage rises and falls",
        {"supply.cycle_v": 2e-3},
        {"supply.cycle_s": 1700.0},
    ),
    "bowed converter": Defect(
        "the converter's characteristic is a bow",
        {"converter.bow_v": 0.02},
    ),
}

UNEXPLAINED: dict[str, Defect] = {
    "charge step": Defect("charge arrives on the plates at one moment", {"oddities.charge_pm": 5.0}),
    "worm gear": Defect("the beta stage's worm gear errs five times a turn", {"stages.beta.worm_deg": 0.1}),
    "cable tug": Defect("a cable tugs in one sector of beta", {"oddities.tug_pm": 5.0}),
    "rocking mount": Defect("gravity rocks the mount from one seat to the other", {"oddities.seat_pm": 5.0}),
    "popping lid": Defect("a lid pops in and out at random", {"oddities.lid_pm": 5.0}),
    "grain of dust": Defect("a grain of dust stops the fingers", {"oddities.dust_fraction": 2e-3}),
}
