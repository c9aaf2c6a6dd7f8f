"""Fault indices, confidence and the verdict on every sensor."""
