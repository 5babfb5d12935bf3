"""Controllers in Python of the included scenes, in the form of a user's file (user_controller.py)."""
