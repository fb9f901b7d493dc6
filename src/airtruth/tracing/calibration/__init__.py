"""Calibration of the sensors on the fitted records before the search: slow noise, corners, the error of the airspeed."""
