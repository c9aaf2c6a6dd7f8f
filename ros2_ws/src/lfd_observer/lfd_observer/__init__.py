"""The bank of sliding mode observers: prediction horizons in, acceleration limits out."""
