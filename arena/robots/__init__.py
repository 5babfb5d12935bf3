"""Robots: the controller interface, firmware and scripted controllers, Bluetooth links."""
