"""Exporting: a calibrated model in the file formats of other programs, and the error of the effects left out.

simulated       outputs of a model over the range of its data
linear_form     the equation that other programs apply, fitted to these outputs
autopilots      parameter files of PX4 and ArduPilot
robotics        matrices of imu_calib (ROS), imu_tk and imucal
noise_files     noise of an inertial measurement unit, for Kalibr and OpenVINS
formats         all formats by name
"""
