"""The e-puck's camera: sensor registers, exposure, line timing and pixel bytes."""
