"""The I2C module as master and slave, and the I2C bus with the board's slaves."""
