"""Physics that both sides of a flight log share: atmosphere, gusts, sensors, actuators, the short period."""
