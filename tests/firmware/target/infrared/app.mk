DEVICES := infrared camera i2c
