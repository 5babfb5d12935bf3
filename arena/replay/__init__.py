"""Presentation of recorded and running trials: replay page, video, filmstrip, live feed and HTTP request handler."""
