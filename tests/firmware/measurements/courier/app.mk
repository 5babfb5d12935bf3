DEVICES := camera i2c
