DEVICES := analog
