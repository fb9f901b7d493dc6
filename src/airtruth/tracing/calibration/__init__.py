"""What the fitted records show of their sensors before anything is traced: slow noise, corners, the error of the airspeed."""
