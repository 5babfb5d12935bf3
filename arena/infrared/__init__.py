"""Infrared light between robots: the sensor ring, propagation, and the channel that all robots share."""
