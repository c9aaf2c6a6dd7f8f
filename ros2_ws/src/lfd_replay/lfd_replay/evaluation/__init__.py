"""The paper's evaluation, and the detectors that people would pick instead."""
