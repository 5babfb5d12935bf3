DEVICES := infrared update
