"""Places of the signal chain: their names, and the catalogue effects that act at each. It loads nothing else."""

from __future__ import annotations

PREFIX = "free:"  # of the name of an effect of unknown form: free:PLACE
PLACES = {
    "stage-angle-alpha": "error of the angle alpha over alpha",
    "stage-angle-beta": "error of the angle beta over beta, and over the side from which it came",
    "tilt-over-time": "tilt and turn of the base over the time",
    "own-response": "output over the specific force along the own axis",
    "cross-response": "output over the specific force along the other axis in the plane",
    "z-response": "output over the specific force along the axis out of the plane",
    "scale-over-cross": "scale factor over the specific force along the other axis in the plane",
    "scale-over-z": "scale factor over the specific force along the axis out of the plane",
    "force": "output over products of forces along several axes",
    "history": "output over the forces passed on the way: slip elements and branches",
    "beta-bias": "output over the angle beta, whatever the force: a field of the room, a cable",
    "temperature-bias": "output over the temperature",
    "temperature-scale": "scale factor over the temperature",
    "temperature-axes": "direction of the sensing axes over the temperature",
    "time-bias": "output over the time",
    "time-scale": "scale factor over the time",
    "output": "output of all axes over the output itself: the converter",
}  # and column:NAME, a logged column
KINDS_OF_FORMS = ("poses", "positions", "motion")  # of data, that can show a free form
HISTORY = "history"
PRODUCTS = ("scale-over-cross", "scale-over-z")  # places whose effects the curve of the place "force" describes too
GEOMETRY_PLACE = "geometry"  # a matrix and two angles: no free form, but a search can leave it out
AT_REST = ("temperature-bias", "time-bias")  # and column:NAME: what one orientation shows
EFFECTS_AT = {
    "stage-angle-alpha": (),
    "stage-angle-beta": ("stage-eccentricity", "stage-backlash"),
    "tilt-over-time": (),
    "own-response": ("quadratic-nonlinearity", "cubic-nonlinearity", "odd-quadratic-nonlinearity",
                     "scale-factor-asymmetry", "dead-zone", "saturation"),
    "cross-response": ("cross-axis-bias",),
    "z-response": ("z-axis-bias",),
    "scale-over-cross": ("cross-axis-scale",),
    "scale-over-z": ("z-axis-scale",),
    "force": (),
    "history": ("hysteresis",),
    "beta-bias": (),
    "temperature-bias": ("temperature-bias", "temperature-hysteresis"),
    "temperature-scale": ("temperature-scale",),
    "temperature-axes": (),
    "time-bias": ("warm-up-bias", "bias-drift"),
    "time-scale": ("warm-up-scale",),
    "output": ("adc-nonlinearity", "quantisation"),
    "column:supply_v": ("supply-sensitivity",),
    "column:std": ("vibration-rectification",),
    GEOMETRY_PLACE: ("axis-misalignment", "axis-nonorthogonality", "stage-zero-offset", "base-tilt"),
}  # the catalogue effects of each place  # fmt: skip


def acts_at_rest(place: str) -> bool:
    """Whether data at one orientation can show what acts at a place: no force drives it, nor multiplies it."""
    return place in AT_REST or place.startswith("column:")


def place_of_effect(name: str) -> str:
    """The place at which an effect of a model acts; "" for bias, scale factor and effects that the user wrote."""
    if name.startswith(PREFIX):
        return name.removeprefix(PREFIX)
    return next((place for place, effects in EFFECTS_AT.items() if name in effects), "")


def is_visible_at_rest(name: str) -> bool:
    """Whether data at one orientation can show a catalogue effect, or may show an effect that the user wrote."""
    place = place_of_effect(name)
    return acts_at_rest(place) or name == "quantisation" or (not place and name != "scale-factor")
