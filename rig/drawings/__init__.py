"""Drawings of the rig for a technician: the position of the stages, and the mounting of the sensor.

attitude    the four numbers, and where the sensor's axes point
page        the whole drawing as SVG: the rig, the tilt of alpha, the table of beta, the specific force on the sensor
strip       the same in three views side by side, for a page of the workbench
sketch      the table of beta in a terminal, as braille
orientation_map    the orientations of a sensor in a hand, in a terminal; orientation_drawing, in a page
named       which drawing belongs to a question
"""

from rig.drawings.attitude import Attitude, drawing_of
from rig.drawings.orientation_map import orientation_drawing, orientation_map
from rig.drawings.page import page, strip
from rig.drawings.sketch import sketch

__all__ = ["Attitude", "drawing_of", "orientation_drawing", "orientation_map", "page", "sketch", "strip"]
