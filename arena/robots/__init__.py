"""Robots as the world runs them: the controller interface, firmware and scripted controllers, Bluetooth links."""
