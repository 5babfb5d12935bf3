DEVICES := camera i2c remote analog led bluetooth battery spi
