"""Recorded and running trials for people: replay page, video, filmstrip, live feed and their HTTP server."""
