"""The I2C module as master and slave, and the two-wire bus with the slaves of the board."""
