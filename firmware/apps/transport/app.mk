DEVICES := analog camera i2c
