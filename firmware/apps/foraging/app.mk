DEVICES := analog bluetooth camera i2c
