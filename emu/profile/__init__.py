"""Where cycles go: `shares` counts them, `follow` knows who called whom, the rest writes files for viewers."""
