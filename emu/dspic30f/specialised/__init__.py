"""The specialised interpreter: Python source generated per stretch of program."""
