"""Devices for motors: motor control PWM and quadrature encoder interface."""
