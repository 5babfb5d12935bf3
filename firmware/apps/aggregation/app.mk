DEVICES := camera i2c remote
