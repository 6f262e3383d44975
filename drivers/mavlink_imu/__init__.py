"""A flight controller that sends the samples of its inertial sensors by MAVLink."""
