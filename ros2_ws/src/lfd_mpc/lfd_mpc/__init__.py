"""The 100 Hz model predictive controller: samples in, prediction horizons out."""
