# The camera's registers are written over I2C.
$(if $(filter i2c,$(DEVICES)),,$(error DEVICES=$(DEVICES): the camera needs i2c, too: DEVICES := camera i2c))
