DEVICES := camera i2c spi remote analog led battery bluetooth
