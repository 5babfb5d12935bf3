"""The Kilobot: an ATmega328P with two vibration motors, a colour LED and infrared, alone or in a swarm."""
